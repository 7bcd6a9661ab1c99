"""The models as a renderer meets them: many materials and lights in one picture; and their price to import."""

import subprocess
import sys

import numpy as np

from obscurance.raytrace import (
    Camera,
    CookTorrance,
    Lambert,
    Mesh,
    Object,
    OrenNayar,
    Phong,
    Scene,
    Settings,
    Shape,
    render,
)
from obscurance.raytrace.brdf.reflect import reflect
from obscurance.raytrace.lights.kernels import incident
from obscurance.raytrace.lights.sources import AmbientLight, DirectionalLight, PointLight, SpotLight
from obscurance.scenes.geometry.primitives import sphere

BALL = sphere(0.5, 0.05).mesh
MATERIALS = [
    Lambert(albedo=(0.2, 0.4, 0.6), emission=0.1),
    Phong(k_d=0.4, k_s=0.5, exponent=9),
    CookTorrance(albedo=0.5, k_s=0.4, m=0.3),
    OrenNayar(albedo=0.7, sigma=0.5),
]
BODIES = [MATERIALS[0], Phong(k_d=0.4), Lambert(albedo=0.3), MATERIALS[3]]
"""The materials without their gloss, which reflect their diffuse term alone."""
LIGHTS = [
    AmbientLight(intensity=(0.1, 0.2, 0.3)),
    PointLight(position=(0, 0, 3), intensity=(5, 6, 7)),
    PointLight(position=(0, 0, 400), intensity=1),
    SpotLight(position=(2, 2, 2), direction=(-1, -1, -1), half_angle=34.4, exponent=2, intensity=9),
    DirectionalLight(direction=(0.3, 0.1, -1), intensity=0.8),
]


def test_a_picture_is_the_sum_over_lights_and_materials():
    """I = I_e + k_a I_a + Σ_l f_rad f_ang I_l reflect, at points of a ball of each material."""
    places = [(1.2 * k - 1.8, 0, 0) for k in range(len(MATERIALS))]
    balls = zip(places, MATERIALS, strict=True)
    items = [Object(Shape(Mesh(at + BALL.vertices, BALL.faces), material)) for at, material in balls]
    camera = Camera((0, -6, 1), (0, 0, 0), field_of_view=20)
    settings = Settings(width=80, height=32, samples=1, shadows=False)
    layers = render(Scene(tuple(items), tuple(LIGHTS)), camera, settings).layers
    rows, columns = np.nonzero(layers["object_id"][..., 0])
    v = -camera.directions((2 * columns + 1 - 80) / 32, 1 - (2 * rows + 1) / 32)
    normals = layers["normal"][rows, columns].astype(float)
    which = layers["object_id"][rows, columns, 0].astype(int) - 1
    points = camera.position - layers["depth"][rows, columns].astype(float) * v
    expected, diffuse = np.empty((len(rows), 3)), np.zeros((len(rows), 3))
    for i, point in enumerate(points):
        material = MATERIALS[which[i]]
        k_a = material.k_a or getattr(material, "albedo", None) or material.k_d
        expected[i] = np.array(material.emission) + np.array(k_a) * LIGHTS[0].intensity
        for light in LIGHTS[1:]:
            l, _, rgb = incident(*light.pack(), tuple(point))
            expected[i] += reflect(material, normals[i], l, v[i]) * rgb
            diffuse[i] += reflect(BODIES[which[i]], normals[i], l, v[i]) * rgb
    assert np.bincount(which).min() > 50
    np.testing.assert_allclose(layers["beauty"][rows, columns, :3], expected, rtol=1e-3, atol=1e-4)
    np.testing.assert_allclose(layers["diffuse"][rows, columns], diffuse, rtol=1e-3, atol=1e-4)


def test_materials_and_lights_are_declared_without_compiling():
    code = (
        "import sys; import obscurance.raytrace.brdf.registry, obscurance.raytrace.brdf.reflect; "
        "from obscurance import raytrace as m; "
        "import obscurance.raytrace.lights.sources, obscurance.raytrace.image.write; "
        "obscurance.raytrace.brdf.registry.reflection_models(); "
        "m.CookTorrance(albedo=.5, m=.2).pack(); m.PoulinFournier(k_d=.5).pack(); "
        "print([x for x in ('numba', 'OpenImageIO', 'scipy', 'embreex') if x in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
