"""Pages hold what was baked, and nothing that leads out of them."""

import base64
import re

import numpy as np
import pytest
from meshes import MESHES
from pages import columns_of, faces_of, facts_of, vectors_of

from obscurance import ao, scenes
from obscurance.raytrace import Mesh, OptionError
from obscurance.scenes.show import look
from obscurance.scenes.show.page.document import html_of_bakes
from obscurance.scenes.show.page.encode import Values


@pytest.fixture(scope="module")
def mesh():
    return Mesh(*MESHES["soup"], source="soup.ply")


@pytest.fixture(scope="module")
def values(mesh):
    rng = np.random.default_rng(1)
    count = len(mesh.vertices)
    bent = rng.normal(size=(count, 3))
    bent[3] = 0
    return Values(
        w=np.append(rng.random(count - 2), [0, 1]),
        error=rng.exponential(0.01, count),
        flags=rng.integers(0, 32, count).astype(np.uint8),
        bent_normals=bent / np.maximum(np.linalg.norm(bent, axis=1, keepdims=True), 1e-9),
        name="soup.npz",
    )


@pytest.fixture(scope="module")
def page(mesh, values):
    return html_of_bakes(mesh, [values], "soup")


def test_values_are_as_baked_to_their_bits(page, values):
    found, about = columns_of(page), facts_of(page)
    assert abs(found["w0"] / 65535 - values.w).max() <= 0.5 / 65535 + 1e-12
    assert found["w0"][-2:].tolist() == [0, 65535]
    error = about["bakes"][0]["errorTop"] * (found["error0"] / 255) ** 2
    assert abs(error - values.error).max() <= values.error.max() / 200
    np.testing.assert_array_equal(found["flags0"], values.flags)
    bent = vectors_of(found["bent0"], 255)
    assert (bent[3] == 0).all()
    assert (bent * values.bent_normals).sum(axis=1)[np.arange(len(bent)) != 3].min() > np.cos(np.radians(1))


def test_the_mesh_is_the_same_to_16_bits(page, mesh):
    found, about = columns_of(page), facts_of(page)
    positions = about["low"] + found["positions"].reshape(-1, 3) * np.array(about["step"])
    assert (abs(positions - mesh.vertices) <= 0.51 * np.array(about["step"])).all()
    turned = {tuple(np.roll(face, -np.argmin(face))) for face in mesh.faces}
    assert {tuple(face) for face in faces_of(found)} == turned
    assert len(faces_of(found)) == len(mesh.faces)
    assert about["vertices"] == len(mesh.vertices)


def test_a_flat_mesh_and_a_single_point_of_it_are_held():
    flat = Mesh([[0, 0, 5], [1, 0, 5], [0, 1, 5]], [[0, 1, 2], [1, 1, 1]])
    about = facts_of(scenes.html_page(flat, [0, 0.5, 1]))
    assert about["step"][2] == 0
    assert about["low"][2] == 5


def test_only_what_is_known_is_held(mesh):
    found = columns_of(scenes.html_page(mesh, np.ones(len(mesh.vertices))))
    assert set(found) == {"faces", "positions", "normals", "again", "further", "w0"}


def test_nothing_leads_out_of_a_page(page):
    text = page.decode()
    assert (
        re.findall(r"(?:https?:)?//[\w.]+\.\w+|\bsrc\s*=|\bhref\s*=|@import|url\(|import\(|fetch\(|XMLHttp", text) == []
    )
    policy = re.search('<meta http-equiv="Content-Security-Policy" content="([^"]*)">', text)[1]
    assert policy.startswith("default-src 'none'; ")
    assert re.fullmatch(r"(script|style)-src 'sha256-[\w+/]{43}='", policy.split("; ")[-1])
    assert "unsafe" not in policy


def test_the_same_bake_gives_the_same_bytes(page, mesh, values):
    assert html_of_bakes(mesh, [values], "soup") == page
    packed = re.search(rb'id="data">(.{24})', page)[1]
    assert base64.b64decode(packed)[4:8] == bytes(4)  # gzip's time


def test_two_bakes_share_a_mesh(mesh, values, page):
    other = Values(1 - values.w, name="other.npy")
    both = html_of_bakes(mesh, [values, other], "two")
    found = columns_of(both)
    assert abs(found["w0"] / 65535 + found["w1"] / 65535 - 1).max() <= 1.1 / 65535
    assert [bake["name"] for bake in facts_of(both)["bakes"]] == ["soup.npz", "other.npy"]
    assert facts_of(both)["differenceShown"] == 1
    assert len(both) < 1.5 * len(page)


def test_names_cannot_become_part_of_the_page(mesh):
    name = '</script><img src="x" onerror="alert(1)">\x1b&'
    text = html_of_bakes(mesh, [Values(np.ones(len(mesh.vertices)), name=name)], name).decode()
    assert "<img" not in text
    assert "\x1b" not in text
    assert facts_of(text.encode())["bakes"][0]["name"] == name


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"w": [0.5]}, "w: expected shape (58,), got (1,)"),
        ({"w": [2] * 58}, "w: expected numbers in [0, 1], got 2"),
        ({"w": [np.nan] * 58}, "w: expected numbers in [0, 1], got nan"),
        ({"w": ["a"] * 58}, "w: expected an array of numbers"),
        ({"error": [-1] * 58}, "error: expected numbers in [0, 100], got -1"),
        ({"error": [np.inf] * 58}, "error: expected numbers in [0, 100], got inf"),
        ({"up": "up"}, "up: expected one of x, y, z, -x, -y, -z"),
        ({"flags": [0] * 57}, "flags: expected shape (58,)"),
        ({"flags": [999] * 58}, "flags: expected"),
        ({"bent_normals": np.ones((58, 2))}, "bent_normals: expected shape (58, 3)"),
    ],
)
def test_values_of_another_mesh_are_refused(mesh, change, field):
    with pytest.raises(OptionError) as raised:
        scenes.html_page(mesh, **{"w": np.ones(58), **change})
    assert field in str(raised.value)


def test_no_bake_or_three_are_refused(mesh, values):
    for count in (0, 3):
        with pytest.raises(OptionError, match="one or two"):
            html_of_bakes(mesh, [values] * count, "many")


def test_every_flag_has_its_colour_at_its_bit():
    assert [flag.name.lower() for flag in ao.Flag] == list(look.FLAGS)
    assert [flag.value for flag in ao.Flag] == [1 << bit for bit in range(len(look.FLAGS))]
