"""`obscurance falloff`, `render --baked --half-distance` and scenes: another falloff from a stored profile."""

import numpy as np
import pytest
from command import obscurance, refused_without_a_trace, succeeded
from mesh_files import with_profile
from meshes import hills

from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.raytrace.image.read import read_image
from obscurance.scenes.asset.asset import Asset
from obscurance.scenes.formats.images import write_grey
from obscurance.scenes.formats.load import load
from obscurance.scenes.formats.stored_w import find_profile, read_w
from obscurance.scenes.formats.write import write


@pytest.fixture(scope="module")
def bake():
    vertices, faces = hills(6)
    return with_profile(ao.bake(Mesh(vertices, faces), samples=4))


@pytest.fixture
def folder(tmp_path, bake, monkeypatch):
    """Baked files with profiles: of vertices, of texels; `plain.ply` without one; and the mesh."""
    monkeypatch.chdir(tmp_path)
    plain = ao.bake(bake.mesh, samples=4)
    write("plain.ply", plain, Asset.of(bake.mesh))
    write("plain.npz", plain, Asset.of(bake.mesh))
    for ending in ("ply", "npz", "glb"):
        write(f"m.{ending}", bake, load("plain.ply", f"m.{ending}"))
    page = ao.Profile(0.1 * 2.0 ** np.arange(10), np.random.default_rng(1).random((4, 5, 10), np.float32), 2.0)
    write_grey(tmp_path / "t.exr", page.values[..., 0], False, {"content": "w"}, profile=page)
    return tmp_path


@pytest.mark.parametrize("source", ["m.ply", "m.npz", "m.glb"])
@pytest.mark.parametrize("ending", [".npy", ".npz", ".ply", ".glb"])
def test_every_format_gets_w_of_another_half_distance(folder, bake, source, ending):
    mesh = ["--mesh", "plain.ply"] if source == "m.npz" and ending in (".ply", ".glb") else []
    done = succeeded("falloff", source, "--half-distance", "12%", "-o", f"out{ending}", *mesh)
    assert f"out{ending}: w at 12%, " in done.stdout
    count = len(load(source).mesh.vertices) if source == "m.glb" and ending != ".glb" else len(bake.w)
    w = read_w(folder / f"out{ending}", count)
    assert np.abs(w[: len(bake.w)] - bake.profile.at("12%")).max() < 1e-4
    if ending != ".npy":
        assert np.allclose(find_profile(folder / f"out{ending}").values[: len(bake.w)], bake.profile.values, atol=1e-5)


def test_two_scales_are_multiplied(folder, bake):
    arguments = "--half-distance", "3%,40%", "--power", "1,.5"
    done = obscurance("falloff", "m.npz", *arguments, "-o", "two.npz")
    assert "w at 3% × w at 40% to the power of 0.5" in done.stdout
    expected = bake.profile.at("3%") * np.sqrt(bake.profile.at("40%"))
    assert np.allclose(read_w(folder / "two.npz", len(bake.w)), expected, atol=1e-6)
    assert "error" not in np.load("two.npz").files
    assert np.array_equal(np.load("two.npz")["flags"], bake.flags)


def test_a_texture_and_a_page(folder):
    assert obscurance("falloff", "t.exr", "--half-distance", "50%", "-o", "out.exr", "-q").stdout == ""
    expected = find_profile(folder / "t.exr").at(1.0)
    assert np.allclose(read_image("out.exr")[0]["beauty"][..., 0], expected, atol=1e-6)
    assert np.array_equal(find_profile(folder / "out.exr").values, find_profile(folder / "t.exr").values)
    succeeded("falloff", "t.exr", "--half-distance", "50%", "-o", "out.png")
    succeeded("falloff", "m.ply", "--half-distance", "50%", "-o", "out.html")
    assert b"obscurance falloff m.ply --half-distance {} -o m-falloff.ply" in (folder / "out.html").read_bytes()


def test_pictures_are_those_of_the_w_that_falloff_writes(folder):
    (folder / "scene.toml").write_text(
        '[render]\nwidth = 24\nheight = 16\nsamples = 1\n[obscurance]\nbaked = "m.npz"\nhalf_distance = "3%,40%"\n'
        'power = "1,.5"\n[[objects]]\nmesh = "plain.ply"\n'
    )
    common = "--width", 24, "--height", 16, "--samples", 1, "-q"
    scales = "--half-distance", "3%,40%", "--power", "1,.5"
    lines = [
        ("falloff", "m.npz", *scales, "-o", "two.npz", "-q"),
        ("render", "plain.ply", "--baked", "two.npz", "-o", "a.exr", *common),
        ("render", "plain.ply", "--baked", "m.npz", *scales, "-o", "b.exr", *common),
        ("render", "plain.ply", "--baked", "m.npz", "-o", "w.exr", *common),
        ("render", "scene.toml", "-o", "c.exr", "-q"),
        ("render", "scene.toml", "--baked", "two.npz", "-o", "d.exr", "-q"),
    ]
    for line in lines:
        succeeded(*line)
    a, b, w, c, d = (read_image(f"{name}.exr")[0]["obscurance"] for name in "abwcd")
    assert np.abs(a - b).max() < 1e-6
    assert np.abs(a - w).max() > 0.01
    assert np.abs(c - d).max() < 1e-6


MISTAKES = [
    ("falloff m.ply --half-distance 300% -o x.ply", "expected one of the profile's, ", "(0.51 to 261.1 %"),
    ("falloff m.npz --half-distance .0000001 -o x.npz", "falloff --half-distance: expected one of the profile's"),
    ("falloff m.glb --half-distance 12%,1e9 -o x.npz", "falloff --half-distance: expected one of the profile's"),
    *(
        (f"falloff m.ply --half-distance {length} -o x.ply", "falloff --half-distance: expected a ")
        for length in ("0", "-1", "nan", "inf", "x", "12%,")
    ),
    ("falloff m.ply --half-distance 3%,4% --power 1 -o x.ply", "falloff --power: expected one for each half-distance"),
    *(
        (f"falloff m.ply --half-distance 3% --power {power} -o x.ply", "falloff --power: expected a number above 0")
        for power in ("0", "-1", "nan", "inf", "x", "1,2")
    ),
    ("falloff plain.ply --half-distance 3% -o x.ply", "plain.ply: profile: expected w at several half-", "none"),
    ("falloff plain.npz --half-distance 3% -o x.npz", "plain.npz: profile: expected w at several half-distances"),
    ("falloff plain.npy --half-distance 3% -o x.npy", "falloff BAKED: expected a name ending in .exr or .glb"),
    ("falloff none.ply --half-distance 3% -o x.ply", "none.ply: file: expected an existing file"),
    ("falloff m.ply --half-distance 3% -o m.ply", "falloff --output: expected a file that is not read"),
    ("falloff m.ply --half-distance 3% -o x.png", "falloff --output: expected a name ending in .glb"),
    ("falloff t.exr --half-distance 3% -o x.ply", "falloff --output: expected a name ending in .png"),
    ("falloff m.npz --half-distance 3% -o x.ply", "falloff --mesh: expected --mesh with the mesh that m.npz"),
    ("falloff m.ply --half-distance 3% -o x.ply --mesh m.glb", "falloff: --mesh needs a .npz"),
    ("falloff m.ply -o x.ply", "falloff: expected --half-distance, got nothing"),
    ("render m.ply --half-distance 3% -o x.png", "render: --half-distance needs --baked"),
    ("render m.ply --baked m.npz --power 2 -o x.png", "render: --power needs --half-distance"),
    ("render m.ply --baked plain.npz --half-distance 3% -o x.png", "plain.npz: profile: expected w at several"),
    ("render m.ply --baked m.npz --half-distance 300% -o x.png", "render --half-distance: expected one of the"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "words"), [(line, words) for line, *words in MISTAKES])
def test_mistakes_are_one_line_and_write_nothing(folder, line, words):
    refused_without_a_trace(folder, words, *line.split())


@pytest.mark.parametrize(
    ("table", "field"),
    [
        ('baked = "m.npz"\nhalf_distance = "x"', "obscurance.half_distance"),
        ('baked = "m.npz"\nhalf_distance = "3%"\npower = [1]', "obscurance.power"),
        ('baked = "m.npz"\npower = 2', "obscurance.power"),
        ("power = 2", "obscurance.power"),
        ('baked = "m.npz"\nhalf_distance = "3%"\ntau = 1.0', "obscurance.tau"),
    ],
)
def test_mistakes_in_scenes_say_the_key(folder, table, field):
    (folder / "scene.toml").write_text(f'[obscurance]\n{table}\n[[objects]]\nmesh = "plain.ply"\n')
    refused_without_a_trace(folder, [f"scene.toml: {field}: expected "], "render", "scene.toml", "-o", "x.png")


def test_a_mesh_of_another_count_is_refused(folder):
    write("other.ply", ao.bake(Mesh(*hills(3)), samples=1), Asset.of(Mesh(*hills(3))))
    line = "falloff m.npz --half-distance 3% -o x.ply --mesh other.ply"
    refused_without_a_trace(folder, ["m.npz: profile: expected a row for each of the 9 vertices"], *line.split())
