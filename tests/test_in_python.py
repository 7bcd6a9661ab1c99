"""The libraries as they are met in an interpreter or a notebook: names, messages, reprs, help."""

import inspect
import pydoc
from dataclasses import replace

import numpy as np
import pytest
from rendered import CAMERA, SMALL, still_scene

import ao
import raytrace
from raytrace import Mesh
from raytrace.errors import MeshError, OptionError
from scenes.shapes import icosphere

BALL = Mesh(*icosphere(1), source="ball")
MODELS = (
    "Lambert", "Phong", "BlinnPhong", "CookTorrance", "EllipticalBeckmann", "OrenNayar", "PoulinFournier", "Strauss",
)  # fmt: skip
LIGHTS = ("PointLight", "SpotLight", "DirectionalLight", "AmbientLight")


@pytest.mark.parametrize("bake", [ao.bake, ao.bake_surface])
@pytest.mark.parametrize(("name", "falloff"), [("binary", ao.Binary()), ("exponential", ao.Exponential())])
def test_a_falloff_by_its_name(bake, name, falloff):
    by_name, made = bake(BALL, name, samples=16), bake(BALL, falloff, samples=16)
    np.testing.assert_array_equal(by_name.w, made.w)
    assert by_name.mu == made.mu


@pytest.mark.parametrize("bake", [ao.bake, ao.bake_surface])
@pytest.mark.parametrize("wrong", ["linear", "Binary", ao.Binary, 3, 0.5])
def test_what_is_no_falloff_is_told(bake, wrong):
    with pytest.raises(OptionError, match=r'falloff: expected ao\.Binary\(…\), .*"exponential", got '):
        bake(BALL, wrong)


def test_the_falloff_that_was_meant():
    with pytest.raises(OptionError, match="got 'Binary'; did you mean binary"):
        ao.bake(BALL, "Binary")


@pytest.mark.parametrize("bake", [ao.bake, ao.bake_surface])
@pytest.mark.parametrize("wrong", ["ball.obj", None, (1, 2)])
def test_what_is_no_mesh_is_told(bake, wrong):
    with pytest.raises(MeshError, match=r"mesh: expected a raytrace\.Mesh, .* got "):
        bake(wrong)


def test_a_frame_is_one_short_line_and_a_picture():
    frame = raytrace.render(still_scene(), CAMERA, SMALL)
    assert repr(frame).startswith("<Frame 96×64: beauty, ambient, diffuse")
    assert len(repr(frame)) < 200
    png = frame._repr_png_()
    assert png.startswith(b"\x89PNG")
    assert png == replace(frame, layers={"beauty": frame.layers["beauty"]})._repr_png_()


def test_everything_large_has_a_short_repr():
    shape = raytrace.Shape(BALL, raytrace.Lambert(albedo=1), uv=np.zeros((42, 2)))
    scene = raytrace.Scene((raytrace.Object(shape, name="moon", w=np.ones(42)),))
    assert repr(BALL) == "<Mesh 'ball': 42 vertices, 80 faces>"
    assert repr(ao.bake(BALL, samples=8)).startswith("<Bake of 42 vertices: w from ")
    for value, holds in ((shape, "<Shape <Mesh 'ball'"), (scene, "<Object 'moon': <Shape"), (scene, "with w")):
        assert holds in repr(value)
        assert len(repr(value)) < 600


@pytest.mark.parametrize("name", MODELS + LIGHTS)
def test_signatures_can_be_read(name):
    kind = getattr(raytrace, name)
    text = str(inspect.signature(kind))
    assert "<" not in text
    assert "Annotated" not in text
    assert set(inspect.signature(kind).parameters) == set(kind.model_fields) - {"model", "light"}
    assert f"{name}{text}" in pydoc.render_doc(kind, renderer=pydoc.plaintext)


def test_needed_parameters_come_first():
    assert str(inspect.signature(raytrace.OrenNayar)).startswith("(*, albedo: Reflectance, sigma: Angle, emission")
