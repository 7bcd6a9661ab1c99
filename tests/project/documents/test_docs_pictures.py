"""The pictures of the documentation are what the commands beside them make; `make pictures` makes them again.

Of the rendered ones a part is made, in the picture's own size: a crop is the same pixels as in the whole.
"""

import pytest
from command import succeeded
from project import ROOT, hide_compiler

from benchmarks.pictures.gallery import commands, page
from benchmarks.pictures.model_strips import STRIPS, picture
from obscurance.raytrace.image.compare import compare
from obscurance.raytrace.image.read import read_image
from obscurance.raytrace.image.write import write_image
from obscurance.scenes.library import BUILTIN

DOCS = ROOT / "docs"
ALLOWED = 0.003  # mean FLIP; a picture of another version of the renderer is .01 and more away
PARTS = {"plane_wall": (192, 174), "cornell": (212, 224), "temple": (282, 204), "sponge": (302, 204)}
WIDTH, HEIGHT = 64, 48


def check_part(folder, name, x, y):
    made, shown = folder / "made.png", folder / "shown.png"
    write, render = commands(name)
    succeeded(*write[1:-1], folder / write[-1])
    size = render[render.index("--width") :]
    succeeded("render", folder / write[-1], "-o", made, *size, "--crop", f"{x},{y},{WIDTH},{HEIGHT}")
    whole = read_image(DOCS / "gallery" / f"{name}.png")[0]["beauty"]
    assert whole.shape[:2] == (int(size[3]), int(size[1]))
    write_image(shown, whole[y : y + HEIGHT, x : x + WIDTH])
    assert compare(shown, made).flip <= ALLOWED


@pytest.mark.parametrize("name", BUILTIN)
def test_the_gallery_shows_what_its_commands_make_without_a_compiler(tmp_path, monkeypatch, name):
    hide_compiler(monkeypatch)
    check_part(tmp_path, name, *PARTS.get(name, (288, 176)))


def test_the_page_of_the_gallery_is_current():
    assert (DOCS / "gallery.md").read_text() == page()


@pytest.mark.slow
def test_the_temple_is_the_demonstration(tmp_path):
    """The middle rows, of both halves; EXR keeps the values as they are."""
    succeeded("demo", "-o", tmp_path / "demo")
    pictures = [read_image(folder / "temple.png")[0]["beauty"] for folder in (DOCS, tmp_path / "demo")]
    assert pictures[0].shape == pictures[1].shape
    middle = len(pictures[0]) // 2
    parts = tmp_path / "shown.exr", tmp_path / "made.exr"
    for part, whole in zip(parts, pictures, strict=True):
        write_image(part, whole[middle - HEIGHT : middle + HEIGHT])
    assert compare(*parts).flip <= ALLOWED


@pytest.mark.parametrize("name", STRIPS)
def test_the_spheres_of_the_models_are_current(tmp_path, name):
    write_image(tmp_path / "made.png", picture(name))
    assert compare(DOCS / "models" / f"{name}.png", tmp_path / "made.png").flip <= ALLOWED
