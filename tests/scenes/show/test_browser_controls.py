"""Pages in a real browser that can reach no host: what hands do with them."""

import numpy as np
import pytest
from browser_pages import HOME, SIZE, address, camera_of, drawn, middle_of, opened, settled, shown, text_of
from meshes import hills

from benchmarks.pictures import chromium
from obscurance.raytrace import Camera, Mesh
from obscurance.raytrace.mesh.mesh import UP
from obscurance.scenes.show.look import FIELD_OF_VIEW
from obscurance.scenes.show.page import document
from obscurance.scenes.show.page.document import html_of_bakes
from obscurance.scenes.show.page.encode import Values

pytestmark = pytest.mark.skipif(chromium.MISSING is not None, reason=str(chromium.MISSING))


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


def test_all_of_the_mesh_stays_in_view_in_a_narrower_window_until_the_camera_moves(tab, pages, bakes):
    framed = Camera.framing(bakes[0], aspect=360 / SIZE[1], field_of_view=FIELD_OF_VIEW)
    for start, expected in (("", framed), (HOME, camera_of(dict(part.split("=") for part in HOME[1:].split("&"))))):
        opened(tab, pages.one + start)
        tab.resize(250 + 360, SIZE[1])
        drawn(tab)
        tab.run("document.getElementById('view').focus()")
        tab.press("2")
        found = camera_of(address(tab, "mode=w"))
        assert found.position == pytest.approx(expected.position, abs=1e-3)
        assert found.target == pytest.approx(expected.target, abs=1e-3)


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


CHECKED = "document.querySelector('%s').checked"


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
        if "#modes" in control:  # until the click has come
            tab.wait(f"document.querySelector('{control}').querySelector?.('input')?.checked ?? {CHECKED % control}")
        mode = tab.run("document.querySelector('#modes input:checked').value")
        tab.run("new Promise((done) => setTimeout(() => setTimeout(done)))")  # the focus comes back later
        assert tab.run("document.activeElement.matches('canvas, select')"), control
        tab.press("ArrowLeft")
        found = address(tab, f"mode={mode}", moved_from=found["position"])
        tab.press("2")
        address(tab, "mode=w")
        tab.wait("document.querySelector('#modes input[value=w]').checked")  # once it has drawn
    tab.drag(tuple(middle_of(tab, "#vertex")))
    for key in ("1", "ArrowLeft"):
        tab.press(key)
    assert address(tab, "mode=w")["position"] == found["position"]
    assert tab.run("document.getElementById('vertex').value").startswith("1")


def test_the_panel_shows_the_last_of_two_changes_within_one_picture(tab, pages):
    opened(tab, pages.two + HOME.replace("clay", "w"))
    tab.run(
        "document.querySelector('#modes input[value=error]').click();"
        "document.body.dispatchEvent(new KeyboardEvent('keydown', { key: '2', bubbles: true }))"
    )
    address(tab, "mode=w")
    drawn(tab)
    assert tab.run(CHECKED % "#modes input[value=w]")


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
        tab.wait("document.documentElement.dataset.firstPicture")
        boxes = "[...document.querySelectorAll('#modes input')].map((e) => e.getBoundingClientRect().bottom)"
        assert len(tab.run(boxes)) == 6
        assert max(tab.run(boxes)) < height


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


def test_a_large_mesh_is_coarse_while_it_turns_and_whole_at_rest(tab, tmp_path, monkeypatch):
    """Of a tenth of the triangles that are many, in cells as much larger, however fast the browser draws."""
    whole_part = document._part

    def part(name):
        text = whole_part(name)
        for old, new in (("CELLS = 128", "CELLS = 40"), ("MANY = 200000", "MANY = 20000"), ("SLOW = 50", "SLOW = 0")):
            assert (old in text) == (name == "coarse.js")
            text = text.replace(old, new)
        return text

    monkeypatch.setattr(document, "_part", part)
    vertices, faces = hills(110)
    mesh = Mesh(vertices @ [[1, 0, 0], [0, 0, -1], [0, 1, 0]], faces)
    assert len(faces) > 20_000
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
