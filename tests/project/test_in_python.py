"""The libraries as they are met in an interpreter or a notebook: names, messages, reprs, help."""

import inspect
import pydoc
import re
from dataclasses import fields, replace
from functools import partial

import numpy as np
import pytest
from rendered import CAMERA, SMALL, still_scene

from obscurance import ao, raytrace
from obscurance.raytrace import Mesh
from obscurance.raytrace.errors import MeshError, OptionError
from obscurance.scenes.geometry.polyhedra import icosphere

BALL = Mesh(*icosphere(1), source="ball")
MODELS = (
    "Lambert", "Phong", "BlinnPhong", "CookTorrance", "EllipticalBeckmann", "OrenNayar", "PoulinFournier", "Strauss",
    "Ward", "AshikhminShirley", "Kajiya", "Warnock",
)  # fmt: skip
LIGHTS = ("PointLight", "SpotLight", "DirectionalLight", "AmbientLight")


@pytest.mark.parametrize("bake", [ao.bake, partial(ao.bake, method="surface")])
@pytest.mark.parametrize("wrong", ["linear", "Binary", ao.Binary, 3, 0.5])
def test_what_is_no_falloff_is_refused(bake, wrong):
    with pytest.raises(OptionError, match=r'falloff: expected ao\.Binary\(…\), .*"exponential", got '):
        bake(BALL, wrong)


@pytest.mark.parametrize("bake", [ao.bake, partial(ao.bake, method="surface")])
@pytest.mark.parametrize("wrong", ["ball.obj", None, (1, 2, 3)])
def test_what_is_no_mesh_is_refused(bake, wrong):
    with pytest.raises(MeshError, match=r"mesh: expected a raytrace\.Mesh, .* got "):
        bake(wrong)


WRONG = {
    "raytrace.render(BALL, CAMERA)": "render: scene: expected a raytrace.Scene, got <Mesh 'ball'",
    "raytrace.render(SCENE, None)": "render: camera: expected a raytrace.Camera, got None",
    "raytrace.render(SCENE, CAMERA, 16)": "render: settings: expected a raytrace.Settings, got 16",
    "raytrace.Shape('ball.obj', WHITE)": "shape: mesh: expected a raytrace.Mesh, a pair (vertices, faces)",
    "raytrace.Shape(BALL, 'gold')": "shape: material: expected a material",
    "raytrace.Shape(BALL, WHITE, uv='planar')": "ball: uv: expected an array of numbers",
    "raytrace.Object(BALL)": "object: shape: expected a raytrace.Shape",
    "raytrace.Object(raytrace.Shape(BALL, WHITE), transform='x')": "object: transform: expected a (4, 4) matrix",
    "raytrace.Object(raytrace.Shape(BALL, WHITE), w=[1, 2])": "object: w: expected shape (42,), got (2,)",
    "raytrace.Scene(BALL)": "scene: objects: expected raytrace.Objects in a tuple or list",
    "raytrace.Scene((BALL,))": "scene: objects[0]: expected raytrace.Objects",
    "raytrace.Scene(SCENE.objects, ('sun',))": "scene: lights[0]: expected lights",
    "raytrace.Scene(SCENE.objects, background='blue')": "scene: background: expected three numbers, got 'blue'",
    "raytrace.reflect('gold', UP, UP, UP)": "reflect: material: expected a material",
    "raytrace.Camera('front', (0, 0, 0))": "camera: position: expected three finite numbers, got 'front'",
    "raytrace.Camera((0, -5, 1), (0, 0, 0), field_of_view='wide')": "camera: field_of_view: expected a number",
    "raytrace.Camera.framing(BALL, 'front')": "camera: direction: expected three numbers, got 'front'",
    "raytrace.Settings(crop=(1, 2))": "render: crop: expected four whole numbers",
    "raytrace.Settings(crop='all!')": "render: crop: expected four whole numbers",
    "raytrace.Lambert(0.5)": "Lambert: values: expected each by its name, as in Lambert(albedo=…), got 0.5",
    "raytrace.PointLight((0, 0, 1))": "as in PointLight(position=…), got (0, 0, 1)",
    "raytrace.material_from_dict('gold')": "material: expected a table of names and values, got 'gold'",
    "raytrace.light_from_dict('sun')": "light: expected a table of names and values, got 'sun'",
    "ao.bake(BALL, only=[True])": "only: expected bool (42,)",
    "ao.bake(BALL, high=BALL, only=[True] * 42)": "high does not go with only",
    "ao.bake(BALL, high=BALL, at='faces')": "high does not go with at",
    "ao.bake(BALL, high=BALL, method='surface')": "high does not go with method",
    "ao.bake(BALL, normals='aera')": "normals: expected one of angle, area, equal, file",
}


@pytest.mark.parametrize(("call", "message"), WRONG.items(), ids=WRONG)
def test_arguments_of_another_kind_are_named(call, message):
    names = {
        "ao": ao, "raytrace": raytrace, "BALL": BALL, "CAMERA": CAMERA, "SCENE": still_scene(), "UP": (0, 0, 1),
        "WHITE": raytrace.Lambert(albedo=1),
    }  # fmt: skip
    with pytest.raises(raytrace.InputError) as caught:
        eval(call, names)
    assert message.replace("got 'front'", "got 'front'") in str(caught.value)


def test_lists_do_for_arrays():
    shape = raytrace.Shape(BALL, raytrace.Lambert(albedo=1), uv=[[0, 1]] * 42)
    scene = raytrace.Scene([raytrace.Object(shape, w=[0.5] * 42)], [raytrace.AmbientLight()])
    assert scene.objects[0].w.dtype == np.float64
    assert isinstance(scene.objects, tuple)
    assert (ao.bake(BALL, samples=8, only=[True] * 42).w == ao.bake(BALL, samples=8).w).all()


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
    assert set(inspect.signature(kind).parameters) == {field.name for field in fields(kind)} - {"model", "light"}
    shown = pydoc.render_doc(kind, renderer=pydoc.plaintext)  # from Python 3.13 on a line for each parameter
    short, whole = (re.sub(r"[\s|]", "", each) for each in (f"{name}{text}", shown))
    assert short in whole


def test_needed_parameters_come_first():
    assert str(inspect.signature(raytrace.OrenNayar)).startswith("(*, albedo: Reflectance, sigma: Angle, emission")
