"""Pages in a real browser: opening them, and what they show."""

import numpy as np

from obscurance.raytrace import Camera
from obscurance.raytrace.image.read import read_image
from obscurance.scenes.show.look import FIELD_OF_VIEW

SIZE = 480, 300
HOME = "#mode=clay&position=1.1,0.9,2.4&target=0.1,0,0"


def drawn(tab):
    """Wait until the page has drawn what was asked for before."""
    tab.run("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def text_of(tab, element):
    """What an element says, once the page has drawn."""
    drawn(tab)
    return tab.run(f"document.getElementById('{element}').textContent")


def shown(tab, folder, element="view"):
    """The canvas as RGB in [0, 1], sRGB-encoded."""
    drawn(tab)
    (folder / "shown.png").write_bytes(tab.screenshot(element))
    picture = read_image(folder / "shown.png")[0]["beauty"][..., :3]
    return np.where(picture <= 0.0031308, 12.92 * picture, 1.055 * np.maximum(picture, 0.0031308) ** (1 / 2.4) - 0.055)


def opened(tab, address, **options):
    """A page that has drawn. The panel takes 250 pixels of its width."""
    tab.messages.clear()
    tab.requests.clear()
    tab.open(address, width=250 + SIZE[0], height=SIZE[1], **options)
    tab.wait("document.documentElement.dataset.firstPicture")


def settled(tab):
    """Wait until the page has done what it does a while after a move."""
    tab.run("new Promise((done) => setTimeout(done, 160))")


def address(tab, *expected, moved_from=None):
    """The parts of the address, once it has the expected ones and, if given, another position than `moved_from`."""
    settled(tab)
    conditions = [f"location.hash.includes({part!r})" for part in expected]
    if moved_from:
        conditions.append(f"!location.hash.includes('position=' + {moved_from!r})")
    tab.wait(" && ".join(conditions) or "true", seconds=20)
    return dict(part.split("=") for part in tab.run("location.hash")[1:].split("&"))


def camera_of(parts):
    numbers = {name: tuple(map(float, parts[name].split(","))) for name in ("position", "target")}
    return Camera(**numbers, up=(0, 1, 0), field_of_view=FIELD_OF_VIEW)


def middle_of(tab, selector):
    """The middle of an element in the window, after what has been scrolled shows it."""
    return tab.run(
        f"(() => {{ const e = document.querySelector({selector!r}); e.scrollIntoView();"
        " const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()"
    )
