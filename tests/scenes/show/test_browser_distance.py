"""The slider of the half-distance, in a real browser that can reach no host."""

import shlex

import numpy as np
import pytest
from browser_pages import HOME, address, drawn, middle_of, opened, settled, shown, text_of
from command import succeeded
from meshes import crumpled, hills

from benchmarks.pictures import chromium
from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.scenes.asset.asset import Asset
from obscurance.scenes.formats.stored_w import read_w
from obscurance.scenes.formats.write import write
from obscurance.scenes.show.page.document import html_of_bakes
from obscurance.scenes.show.page.encode import Values

pytestmark = pytest.mark.skipif(chromium.MISSING is not None, reason=str(chromium.MISSING))
HIGH = {"width": 500, "height": 760}


@pytest.fixture(scope="module")
def bake():
    vertices, faces = crumpled(hills(24), 0.2, 3)
    return ao.bake(Mesh(vertices @ [[1, 0, 0], [0, 0, -1], [0, 1, 0]], faces), samples=32, profile=True)


@pytest.fixture(scope="module")
def folder(bake, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    source = Asset.of(bake.mesh)
    write(folder / "m x.npz", bake, source)
    write(folder / "m.ply", bake, source)
    succeeded("view", folder / "m x.npz", "--mesh", folder / "m.ply", "-o", folder / "m.html")
    return folder


@pytest.fixture
def page(tab, folder):
    def at(address=HOME):
        opened(tab, (folder / "m.html").as_uri() + address)
        tab.call("Emulation.setDeviceMetricsOverride", **HIGH, deviceScaleFactor=1, mobile=False)
        drawn(tab)

    return at


def chosen(tab, share):
    """Drag the slider there from its left end: the half-distance, from the address."""
    x, y, width = tab.run(
        "(() => { const b = document.getElementById('distance').getBoundingClientRect();"
        " return [b.x, b.y + b.height / 2, b.width]; })()"
    )
    tab.drag(*((x + 8 + (width - 16) * share * step / 5, y) for step in range(6)))
    return float(address(tab, "half-distance=")["half-distance"])


def picked(tab, vertex):
    tab.run(f"v = document.getElementById('vertex'); v.value = {vertex}; v.dispatchEvent(new Event('change'))")
    return text_of(tab, "picked")


def test_a_drag_shows_w_of_that_half_distance_at_every_vertex(tab, page, bake):
    page()
    assert " ± " in picked(tab, 5)
    before = tab.run("document.getElementById('histogram').toDataURL()")
    for share in (0.25, 0.8):
        half_distance = chosen(tab, share)
        lengths = bake.profile.half_distances
        place = np.log(half_distance / lengths[0]) / np.log(lengths[-1] / lengths[0])
        assert place == pytest.approx(share, abs=0.02)
        expected = bake.profile.at(half_distance)
        for vertex in range(0, len(expected), 150):
            text = picked(tab, vertex)
            assert float(text.split()[1].rstrip(",")) == pytest.approx(expected[vertex], abs=0.006)
            assert "±" not in text
        percent = float(text_of(tab, "distanceValue").split(", ")[1].split()[0])
        assert percent == pytest.approx(100 * half_distance / bake.profile.radius, rel=0.01)
        after = tab.run("document.getElementById('histogram').toDataURL()")
        assert after != before
        before = after
    assert tab.messages == []


def test_as_baked_brings_w_back(tab, page, bake):
    page()
    chosen(tab, 0.3)
    tab.drag(tuple(middle_of(tab, "#baked")))
    assert "half-distance" not in address(tab)
    vertex = int(np.argmin(bake.w))
    assert picked(tab, vertex).startswith(f"w {bake.w[vertex]:.4f} ± ")
    assert text_of(tab, "distanceValue").startswith("as baked, near ")


def test_the_address_keeps_the_half_distance(tab, page, tmp_path):
    page()
    before = shown(tab, tmp_path)
    chosen(tab, 0.6)
    settled(tab)  # on a slow machine the picture is hasty while the slider is held
    text, picture = text_of(tab, "distanceValue"), shown(tab, tmp_path)
    assert abs(picture - before).mean() > 0.005
    page(tab.run("location.hash"))
    assert text_of(tab, "distanceValue") == text
    assert abs(shown(tab, tmp_path) - picture).mean() < 1e-3
    for wrong in ("x", "1e9"):
        page(f"{HOME}&half-distance={wrong}")
        assert text_of(tab, "distanceValue").startswith("as baked")


@pytest.mark.parametrize("share", [0.4, 1.0])
def test_the_command_that_is_shown_bakes_what_is_shown(tab, page, bake, folder, monkeypatch, share):
    page()
    half_distance = chosen(tab, share)
    tab.drag(tuple(middle_of(tab, "#copy")))
    command = tab.run("getSelection().toString()")
    assert command == tab.run("document.getElementById('permanent').value")
    monkeypatch.chdir(folder)
    name, *words = shlex.split(command)
    assert name == "obscurance"
    succeeded(*words)
    w = read_w(folder / words[-1], len(bake.w))
    assert np.abs(w - bake.profile.at(half_distance)).max() < 0.002


def test_pages_without_a_profile_have_no_slider_and_of_two_bakes_both_follow(tab, bake, tmp_path):
    plain = Values(bake.w, name="plain")
    (tmp_path / "plain.html").write_bytes(html_of_bakes(bake.mesh, [plain], "hills"))
    opened(tab, (tmp_path / "plain.html").as_uri())
    assert tab.run("document.getElementById('falloff').hidden")
    inverse = ao.Profile(bake.profile.half_distances, 1 - bake.profile.values, bake.profile.radius)
    both = Values(bake.w, profile=bake.profile), Values(1 - bake.w, profile=inverse)
    (tmp_path / "both.html").write_bytes(html_of_bakes(bake.mesh, both, "hills"))
    length = bake.profile.half_distances[3]
    opened(tab, (tmp_path / "both.html").as_uri() + f"{HOME}&half-distance={length}")
    first, second = (float(line.split()[2].rstrip(",")) for line in picked(tab, 7).splitlines())
    assert first == pytest.approx(bake.profile.values[7, 3], abs=0.003)
    assert first + second == pytest.approx(1, abs=0.005)
