"""Pages in a real browser that can reach no host: what they draw, and what hands do with them."""

import html
from types import SimpleNamespace

import numpy as np
import pytest
from gltf_samples import half_textured
from meshes import crumpled, hills

import ao
from benchmarks.pictures import chromium
from raytrace import Camera, Mesh, render
from raytrace.image.compare import compare
from raytrace.image.read import read_image
from raytrace.image.write import write_image
from raytrace.mesh.up import UP
from scenes.show.look import FIELD_OF_VIEW, clay_scene, clay_settings
from scenes.show.page.document import html_of_bakes
from scenes.show.page.encode import Values
from scenes.show.page.view import view_results

pytestmark = pytest.mark.skipif(chromium.MISSING is not None, reason=str(chromium.MISSING))
SIZE = 480, 300
HOME = "#mode=clay&position=1.1,0.9,2.4&target=0.1,0,0"


@pytest.fixture(scope="module")
def tab():
    with chromium.browser() as opened:
        yield opened


@pytest.fixture(scope="module")
def bakes():
    vertices, faces = crumpled(hills(24), 0.2, 3)
    mesh = Mesh(vertices @ [[1, 0, 0], [0, 0, -1], [0, 1, 0]], faces)
    return mesh, ao.bake(mesh, samples=64), ao.bake(mesh, ao.Binary(), samples=16)


@pytest.fixture(scope="module")
def pages(bakes, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    mesh, first, second = bakes
    one, two = Values(**_known(first), name="one"), Values(**_known(second), name="two")
    (folder / "one.html").write_bytes(html_of_bakes(mesh, [one], "hills"))
    (folder / "two.html").write_bytes(html_of_bakes(mesh, [one, two], "hills"))
    (folder / "w.html").write_bytes(html_of_bakes(mesh, [Values(first.w)], "hills"))
    return SimpleNamespace(**{name: (folder / f"{name}.html").as_uri() for name in ("one", "two", "w")})


def _known(bake):
    return {name: getattr(bake, name) for name in ("w", "error", "flags", "bent_normals")}


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


def address(tab, *expected):
    """The parts of the address, once it has changed to have the expected ones."""
    settled(tab)
    found = tab.run("location.hash")
    for part in expected:
        assert part in found
    return dict(part.split("=") for part in found[1:].split("&"))


def test_another_axis_can_be_up_and_the_address_keeps_it(tab, pages, bakes):
    opened(tab, pages.one + HOME)
    for axis in ("z", "-x"):
        tab.run(f"u = document.getElementById('up'); u.value = '{axis}'; u.dispatchEvent(new Event('change'))")
        framed = Camera.framing(bakes[0], up=UP[axis], aspect=SIZE[0] / SIZE[1], field_of_view=FIELD_OF_VIEW)
        found = address(tab, f"up={axis}")
        assert camera_of(found).position == pytest.approx(framed.position, abs=1e-3)
        assert camera_of(found).target == pytest.approx(framed.target, abs=1e-3)
    again = tab.run("location.hash")
    opened(tab, pages.one + again)
    tab.run("document.getElementById('view').focus()")
    tab.press("b")
    assert address(tab, "scheme=", "up=-x")["position"] == found["position"]
    assert tab.run("document.getElementById('up').value") == "-x"


def camera_of(parts):
    numbers = {name: tuple(map(float, parts[name].split(","))) for name in ("position", "target")}
    return Camera(**numbers, up=(0, 1, 0), field_of_view=FIELD_OF_VIEW)


def test_clay_is_what_our_renderer_draws(tab, pages, bakes, tmp_path):
    mesh, bake, _ = bakes
    for scheme in ("dark", "light"):
        opened(tab, f"{pages.one}{HOME}&scheme={scheme}")
        (tmp_path / "page.png").write_bytes(tab.screenshot("view"))
        camera = camera_of(dict(part.split("=") for part in HOME[1:].split("&")))
        frame = render(clay_scene(mesh, bake.w, camera, scheme), camera, clay_settings(*SIZE), layers=False)
        write_image(tmp_path / "ours.png", frame.layers["beauty"][..., :3])
        found = compare(tmp_path / "ours.png", tmp_path / "page.png")
        assert found.flip < 0.02  # .012 or less, all of it at edges
        assert tab.messages == []


def test_nothing_is_asked_of_the_network(tab, pages):
    opened(tab, pages.one + HOME)
    assert [request for request in tab.requests if not request.startswith("file:")] == []
    assert len(tab.requests) == 1
    found = tab.run("fetch('https://example.org').then(() => 'came', () => 'refused')")
    assert found == "refused"
    assert any("Content Security Policy" in message for message in tab.messages)


def test_w_is_drawn_as_grey(tab, pages, bakes, tmp_path):
    opened(tab, pages.one + HOME.replace("clay", "w"))
    picture = shown(tab, tmp_path)
    assert abs(picture[..., :1] - picture).max() < 0.1  # but for the background
    middle = picture[SIZE[1] // 2, SIZE[0] // 2, 0]
    tab.run("document.getElementById('view').focus()")
    tab.press("Enter")
    vertex = int(address(tab, "vertex=")["vertex"])
    linear = ((middle + 0.055) / 1.055) ** 2.4
    neighbours = bakes[0].faces[(bakes[0].faces == vertex).any(axis=1)]
    w = bakes[1].w[neighbours]
    assert w.min() - 0.01 <= linear <= w.max() + 0.01


def test_every_mode_draws_something_else_and_has_its_legend(tab, pages, bakes, tmp_path):
    opened(tab, pages.two + HOME)
    tab.run("document.getElementById('view').focus()")
    pictures = []
    for number, legend in enumerate(["", "1 open", "standard error", "folded: ", "red x", "second"], 1):
        tab.press(str(number))
        pictures.append(shown(tab, tmp_path))
        assert legend in text_of(tab, "ticks")
        assert tab.run(f"document.querySelectorAll('#modes input')[{number - 1}].checked")
    assert f"RMSE {bakes[1].rmse:.2g} | {bakes[2].rmse:.2g}" in text_of(tab, "facts")
    for number, picture in enumerate(pictures):
        assert all(abs(picture - other).mean() > 0.01 for other in pictures[:number])
    assert tab.messages == []


def test_flagged_vertices_are_dots_of_their_colour(tab, pages, bakes, tmp_path):
    opened(tab, pages.one + HOME.replace("clay", "flags"))
    folded = int(np.count_nonzero(bakes[1].flags & ao.Flag.FOLDED))
    assert folded > 3
    assert f"folded: {folded}" in text_of(tab, "ticks")
    picture = shown(tab, tmp_path)
    green = (abs(picture - np.array([0x2F, 0xC8, 0x2F]) / 255) < 0.02).all(axis=2)
    assert green.sum() > 20
    tab.run("document.getElementById('view').focus()")
    tab.press("]")
    assert int(address(tab)["vertex"]) == np.flatnonzero(bakes[1].flags)[0]
    assert "folded" in text_of(tab, "picked")


def test_what_a_file_does_not_hold_cannot_be_chosen(tab, pages):
    opened(tab, pages.w + HOME.replace("clay", "error"))
    assert tab.run("[...document.querySelectorAll('#modes input')].map((each) => each.disabled)") == [
        False, False, True, True, True,
    ]  # fmt: skip
    assert tab.run("document.querySelector('#modes input:checked').value") == "clay"
    tab.run("document.getElementById('view').focus()")
    tab.press("4")
    assert tab.run("document.querySelector('#modes input:checked').value") == "clay"


def test_a_vertex_is_picked_by_a_click_and_by_its_number(tab, pages, bakes):
    mesh, bake, _ = bakes
    opened(tab, pages.one + HOME)
    camera = camera_of(dict(part.split("=") for part in HOME[1:].split("&")))
    right, above, forward = camera.axes()
    offset = mesh.vertices - camera.position
    half = np.tan(np.radians(FIELD_OF_VIEW / 2)) * (offset @ forward)
    places = np.stack([offset @ right / half / (SIZE[0] / SIZE[1]), offset @ above / half], axis=1)
    x, y = (places[:, 0] + 1) / 2 * SIZE[0] + 250, (1 - places[:, 1]) / 2 * SIZE[1]
    nearest = np.argmin(np.linalg.norm(offset, axis=1))  # which nothing hides
    tab.drag((x[nearest], y[nearest] + 1))
    picked = int(address(tab, "vertex=")["vertex"])
    assert np.hypot(x[picked] - x[nearest], y[picked] - y[nearest]) < 15
    tab.run(f"const v = document.getElementById('vertex'); v.value = {nearest}; v.dispatchEvent(new Event('change'))")
    text = text_of(tab, "picked")
    assert text.startswith(f"w {bake.w[nearest]:.4f} ± ")
    assert float(text.split()[3].rstrip(",")) == pytest.approx(bake.error[nearest], rel=0.1)
    tab.run(f"v.value = {len(mesh.vertices)}; v.dispatchEvent(new Event('change'))")
    assert "No vertex" in text_of(tab, "picked")


def test_all_of_the_mesh_is_in_view_at_first_and_again_by_a_key(tab, pages, bakes):
    framed = Camera.framing(bakes[0], aspect=SIZE[0] / SIZE[1], field_of_view=FIELD_OF_VIEW)
    for start, keys in (("", "2"), (HOME, "20")):
        opened(tab, pages.one + start)
        tab.run("document.getElementById('view').focus()")
        for key in keys:
            tab.press(key)
        found = camera_of(address(tab, "mode=w"))
        assert found.position == pytest.approx(framed.position, abs=1e-3)
        assert found.target == pytest.approx(framed.target, abs=1e-3)


def test_the_camera_follows_mouse_wheel_keys_and_fingers_and_stands_in_the_address(tab, pages):
    opened(tab, pages.one + HOME)
    start = camera_of(address(tab))
    distance = np.linalg.norm(np.subtract(start.position, start.target))

    def moved():
        return camera_of(address(tab))

    tab.drag((500, 200), (560, 200), (600, 220))
    turned = moved()
    assert turned.target == start.target
    assert np.linalg.norm(np.subtract(turned.position, turned.target)) == pytest.approx(distance)
    assert turned.position != start.position
    tab.drag((500, 200), (540, 200), shift=True)
    panned = moved()
    offset = np.subtract(panned.target, turned.target)
    across = 2 * distance * np.tan(np.radians(FIELD_OF_VIEW / 2)) * 40 / SIZE[1]
    assert np.linalg.norm(offset) == pytest.approx(across, rel=1e-4)
    tab.wheel(500, 200, -200)
    near = moved()
    assert np.linalg.norm(np.subtract(near.position, near.target)) == pytest.approx(distance * np.exp(-0.3))
    tab.run("document.getElementById('view').focus()")
    tab.press("ArrowLeft")
    keyed = moved()
    assert keyed.position != near.position
    tab.touch([(400, 200), (500, 200)], [(350, 200), (550, 200)])
    pinched = moved()
    assert np.linalg.norm(np.subtract(pinched.position, pinched.target)) < 0.6 * distance * np.exp(-0.3)
    tab.touch([(400, 200)], [(420, 230)])
    assert moved().target == pinched.target
    last = moved()
    opened(tab, pages.one + tab.run("location.hash"))
    tab.run("document.getElementById('view').focus()")
    tab.press("2")
    again = camera_of(address(tab, "mode=w"))
    assert again.position == pytest.approx(last.position, abs=1e-6)
    assert again.target == pytest.approx(last.target, abs=1e-6)


def test_the_slider_parts_two_bakes(tab, pages, tmp_path):
    opened(tab, f"{pages.two}{HOME.replace('clay', 'w')}&split=0")
    second = shown(tab, tmp_path)
    opened(tab, f"{pages.one}{HOME.replace('clay', 'w')}")
    first = shown(tab, tmp_path)
    opened(tab, f"{pages.two}{HOME.replace('clay', 'w')}&split=1")
    tab.run("const s = document.getElementById('split'); s.value = 500; s.dispatchEvent(new Event('input'))")
    half = shown(tab, tmp_path)
    middle = SIZE[0] // 2
    above = slice(0, SIZE[1] - 80)
    assert abs(half - first)[above, : middle - 2].mean() < 1e-3
    assert abs(half - second)[above, middle + 2 :].mean() < 1e-3
    assert abs(first - second)[above, middle + 2 :].mean() > 0.005
    assert float(address(tab)["split"]) == 0.5


def test_light_and_dark_are_the_systems_unless_chosen(tab, pages, tmp_path):
    for dark, low in ((True, True), (False, False)):
        opened(tab, pages.one + HOME, dark=dark)
        assert (shown(tab, tmp_path)[2, 2].max() < 0.3) == low
    tab.run("document.getElementById('scheme').click()")
    assert shown(tab, tmp_path)[2, 2].max() < 0.3
    assert address(tab)["scheme"] == "dark"


def test_a_browser_that_cannot_draw_says_so(tab, pages):
    script = "HTMLCanvasElement.prototype.getContext = () => null"
    added = tab.call("Page.addScriptToEvaluateOnNewDocument", source=script)["identifier"]
    tab.open(pages.one)
    tab.wait("!document.getElementById('failure').hidden")
    assert "WebGL 2" in text_of(tab, "failure")
    tab.call("Page.removeScriptToEvaluateOnNewDocument", identifier=added)
    opened(tab, pages.one)
    assert tab.run("document.getElementById('failure').hidden")
    tab.run("document.getElementById('view').getContext('webgl2').getExtension('WEBGL_lose_context').loseContext()")
    tab.wait("!document.getElementById('failure').hidden")


def test_a_page_can_be_shown_within_another(tab, bakes, tmp_path):
    mesh, bake, _ = bakes
    page = html_of_bakes(mesh, [Values(bake.w)], "hills").decode()
    frame = f'<iframe srcdoc="{html.escape(page)}" width="600" height="400"></iframe>'
    (tmp_path / "notebook.html").write_text(f"<!doctype html>{frame}")
    tab.messages.clear()
    tab.open((tmp_path / "notebook.html").as_uri())
    inner = "document.querySelector('iframe').contentDocument"
    tab.wait(f"{inner}.documentElement.dataset.firstPicture")
    tab.run(f"{inner}.getElementById('view').focus()")
    tab.press("2")
    tab.wait(f"{inner}.getElementById('ticks').textContent.includes('1 open')")
    settled(tab)
    assert tab.messages == []


def test_a_browser_shows_the_texture_between_the_vertices(tab, tmp_path):
    codes = np.repeat(np.array([[0, 0, 255, 255]], np.uint8), 2, axis=0)
    one, two = tmp_path / "one.glb", tmp_path / "two.glb"
    for path, each in ((one, codes), (two, 255 - codes)):
        path.write_bytes(half_textured(each, [[0, 1], [1, 1], [1, 0], [0, 0]]))
    view_results(one, two, tmp_path / "one.html", None, "y")
    place = "mode=w&position=1,0.5,4&target=1,0.5,0"
    for side, split in ((0, 1), (1, 0)):
        opened(tab, f"{(tmp_path / 'one.html').as_uri()}#{place}&split={split}")
        picture = shown(tab, tmp_path)[..., 0]
        row = picture[picture.shape[0] // 2] ** 2.2
        left, right, beside = row[150], row[220], row[300]
        assert abs(left - side) < 0.02
        assert abs(right - (1 - side)) < 0.02
        assert abs(beside - 0.25) < 0.02
        assert tab.messages == []
    opened(tab, f"{(tmp_path / 'one.html').as_uri()}#{place.replace('mode=w', 'mode=difference')}")
    picture = shown(tab, tmp_path)
    left, right, beside = (picture[picture.shape[0] // 2, column] for column in (150, 220, 300))
    assert left[0] > 2 * left[2]  # red: the second is lighter
    assert right[2] > 2 * right[0]
    assert abs(beside[0] - beside[2]) < 0.05


def middle_of(tab, selector):
    """The middle of an element in the window, after what has been scrolled shows it."""
    return tab.run(
        f"(() => {{ const e = document.querySelector({selector!r}); e.scrollIntoView();"
        " const b = e.getBoundingClientRect(); return [b.x + b.width / 2, b.y + b.height / 2]; })()"
    )


def test_keys_work_from_the_start_and_after_every_control(tab, pages):
    opened(tab, pages.two + HOME)
    tab.press("2")
    found = address(tab, "mode=w")
    controls = [
        "#modes input[value=error]",
        "#modes label:first-of-type",
        "#scheme",
        "#fit",
        "#strength",
        "#split",
        "summary",
    ]
    for control in controls:
        tab.drag(tuple(middle_of(tab, control)))
        mode = tab.run("document.querySelector('#modes input:checked').value")
        tab.press("ArrowLeft")
        before, found = found, address(tab, f"mode={mode}")
        assert found["position"] != before["position"], control
        tab.press("2")
        address(tab, "mode=w")
    tab.drag(tuple(middle_of(tab, "#vertex")))
    for key in ("1", "ArrowLeft"):
        tab.press(key)
    assert address(tab, "mode=w")["position"] == found["position"]
    assert tab.run("document.getElementById('vertex').value").startswith("1")


def test_the_line_between_two_bakes_is_dragged_anywhere_along_it(tab, pages):
    opened(tab, pages.two + HOME)
    split = 0.5
    for height in (20, 150, 250):
        x = 250 + split * SIZE[0]
        tab.drag((x + 2, height), (x + 40, height), (x + 48, height))
        before, split = split, float(address(tab)["split"])
        assert split == pytest.approx(before + 48 / SIZE[0], abs=0.006)
    assert camera_of(address(tab)) == camera_of(dict(part.split("=") for part in HOME[1:].split("&")))


def test_all_modes_are_in_view_in_a_small_window(tab, pages):
    for width, height in ((500, 300), (700, 300)):
        opened(tab, pages.two + HOME)
        tab.open(pages.two + HOME, width=width, height=height)
        boxes = "[...document.querySelectorAll('#modes input')].map((e) => e.getBoundingClientRect().bottom)"
        assert len(tab.run(boxes)) == 6
        assert max(tab.run(boxes)) < height


def test_range_and_strength_are_for_looking_only_and_stand_in_the_address(tab, pages, bakes, tmp_path):
    place = HOME.replace("clay", "w")
    opened(tab, pages.one + place)
    plain = shown(tab, tmp_path)[..., 0]
    opened(tab, f"{pages.one}{place}&range=0.4,0.9&strength=2")
    toned = shown(tab, tmp_path)[..., 0]
    grey = (plain > 0.2) & (plain < 0.999)
    w = ((plain[grey] + 0.055) / 1.055) ** 2.4
    light = ((np.clip(w, 0.4, 0.9) - 0.4) / 0.5) ** 2
    expected = np.where(light < 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)
    assert np.median(abs(expected - toned[grey])) < 0.005
    assert abs(plain - toned)[grey].mean() > 0.05
    found = address(tab)
    assert (found["range"], found["strength"]) == ("0.4,0.9", "2")
    assert "≤ 0.4" in text_of(tab, "ticks")
    tab.run("document.getElementById('fit').click()")
    low, high = map(float, address(tab, "range=")["range"].split(","))
    assert np.quantile(bakes[1].w, [0.01, 0.99]) == pytest.approx([low, high], abs=0.03)
    tab.run("document.getElementById('baked').click()")
    drawn(tab)
    assert not {"range", "strength"} & set(address(tab))
    assert abs(shown(tab, tmp_path)[..., 0] - plain).max() < 0.01


def test_the_value_under_the_pointer_stands_on_a_scale(tab, pages, bakes, tmp_path):
    opened(tab, pages.one + HOME.replace("clay", "w"))
    grey = shown(tab, tmp_path)[180, 240, 0]
    tab.call("Input.dispatchMouseEvent", type="mouseMoved", x=250 + 240, y=180)
    tab.wait("!document.getElementById('hover').hidden")
    w = float(text_of(tab, "hoverValue").removeprefix("w "))
    assert w == pytest.approx(((grey + 0.055) / 1.055) ** 2.4, abs=0.02)
    assert float(tab.run("document.getElementById('hoverTick').style.left").rstrip("%")) == pytest.approx(
        100 * w, abs=0.1
    )
    tab.press("3")
    drawn(tab)
    assert tab.run("document.getElementById('hover').hidden")
    tab.call("Input.dispatchMouseEvent", type="mouseMoved", x=250 + 241, y=180)
    tab.wait("!document.getElementById('hover').hidden")
    assert 0 < float(text_of(tab, "hoverValue").removeprefix("error ")) <= bakes[1].error.max()


def test_the_picture_is_saved_as_a_png(tab, pages, tmp_path):
    opened(tab, pages.one + HOME)
    picture = shown(tab, tmp_path)
    tab.call("Browser.setDownloadBehavior", behavior="allow", downloadPath=str(tmp_path / "saved"))
    tab.press("p")
    for _ in range(200):
        settled(tab)
        if (tmp_path / "saved" / "hills.png").is_file():
            break
    saved = read_image(tmp_path / "saved" / "hills.png")[0]["beauty"][..., :3]
    linear = np.where(picture <= 0.04045, picture / 12.92, ((picture + 0.055) / 1.055) ** 2.4)
    assert saved.shape == linear.shape
    assert abs(saved - linear).max() < 0.01
    assert tab.messages == []


def test_a_large_mesh_is_coarse_while_it_turns_and_whole_at_rest(tab, tmp_path):
    vertices, faces = hills(350)
    mesh = Mesh(vertices @ [[1, 0, 0], [0, 0, -1], [0, 1, 0]], faces)
    assert len(faces) > 200_000
    (tmp_path / "large.html").write_bytes(html_of_bakes(mesh, [Values(np.linspace(0, 1, len(vertices)))], "hills"))
    opened(tab, (tmp_path / "large.html").as_uri())
    whole = shown(tab, tmp_path)
    tab.call("Input.dispatchMouseEvent", type="mousePressed", x=500, y=200, button="left", buttons=1, clickCount=1)
    tab.call("Input.dispatchMouseEvent", type="mouseMoved", x=510, y=200, button="left", buttons=1)
    settled(tab)
    tab.call("Input.dispatchMouseEvent", type="mouseMoved", x=500, y=200, button="left", buttons=1)
    drawn(tab)
    assert tab.run("document.documentElement.dataset.coarse") == "true"
    few = int(tab.run("document.documentElement.dataset.triangles"))
    assert 1000 < few < len(faces) / 4
    coarse = shown(tab, tmp_path)
    assert 0 < abs(coarse - whole).mean() < 0.02
    tab.call("Input.dispatchMouseEvent", type="mouseReleased", x=500, y=200, button="left", buttons=0, clickCount=1)
    tab.wait("document.documentElement.dataset.coarse === 'false'")
    assert int(tab.run("document.documentElement.dataset.triangles")) == len(faces)
    assert abs(shown(tab, tmp_path) - whole).mean() < 1e-3
