"""Pages in a real browser that can reach no host: what they draw."""

import html

import numpy as np
import pytest
from browser_pages import HOME, SIZE, address, camera_of, drawn, opened, settled, shown, text_of
from gltf_samples import half_textured
from PIL import Image

from benchmarks.pictures import chromium
from obscurance import ao
from obscurance.raytrace import render
from obscurance.raytrace.image.colour import encode_srgb
from obscurance.raytrace.image.compare import compare
from obscurance.raytrace.image.read import read_image
from obscurance.scenes.commands.view import view_results
from obscurance.scenes.show.look import clay_scene, clay_settings
from obscurance.scenes.show.page.document import html_of_bakes
from obscurance.scenes.show.page.encode import Values

pytestmark = pytest.mark.skipif(chromium.MISSING is not None, reason=str(chromium.MISSING))


def test_clay_is_what_our_renderer_draws(tab, pages, bakes, tmp_path):
    mesh, bake, _ = bakes
    for scheme in ("dark", "light"):
        opened(tab, f"{pages.one}{HOME}&scheme={scheme}")
        (tmp_path / "page.png").write_bytes(tab.screenshot("view"))
        camera = camera_of(dict(part.split("=") for part in HOME[1:].split("&")))
        frame = render(clay_scene(mesh, bake.w, camera, scheme), camera, clay_settings(*SIZE), layers=False)
        codes = np.rint(255 * encode_srgb(frame.layers["beauty"][..., :3]))  # a page is not dithered
        Image.fromarray(codes.astype(np.uint8)).save(tmp_path / "ours.png")
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
