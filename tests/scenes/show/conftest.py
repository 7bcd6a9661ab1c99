"""A browser that can reach no host, and pages of bakes."""

from types import SimpleNamespace

import pytest
from meshes import crumpled, hills

from benchmarks.pictures import chromium
from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.scenes.show.page.document import html_of_bakes
from obscurance.scenes.show.page.encode import Values


@pytest.fixture(scope="package")
def tab():
    with chromium.browser() as opened:
        yield opened


@pytest.fixture(scope="package")
def bakes():
    vertices, faces = crumpled(hills(24), 0.2, 3)
    mesh = Mesh(vertices @ [[1, 0, 0], [0, 0, -1], [0, 1, 0]], faces)
    return mesh, ao.bake(mesh, samples=64), ao.bake(mesh, ao.Binary(), samples=16)


@pytest.fixture(scope="package")
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
