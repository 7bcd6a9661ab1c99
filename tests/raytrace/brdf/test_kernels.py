"""The models as a renderer meets them: many materials and lights inside one kernel; and their price to import."""

import subprocess
import sys

import numpy as np

from raytrace import CookTorrance, Lambert, OrenNayar, Phong
from raytrace.brdf import layout
from raytrace.brdf.dispatch import evaluate, terms
from raytrace.brdf.material import pack_materials
from raytrace.kernel.jit import kernel
from raytrace.kernel.vector import add, dot, load, triple
from raytrace.lights.kernels import incident
from raytrace.lights.layout import AMBIENT
from raytrace.lights.sources import AmbientLight, DirectionalLight, PointLight, SpotLight, pack_lights
from raytrace.materials.reflect import reflect


@kernel
def shade(kinds, rows, which, points, normals, viewers, light_kinds, light_rows, threshold, out):
    """I = I_e + k_a I_a + Σ_l f_rad f_ang I_l reflect, skipping what cannot matter; returns how many were skipped."""
    skipped = 0
    none = (0.0, 0.0, 0.0)
    for i in range(len(out)):
        kind, row = kinds[which[i]], rows[which[i]]
        p, n, v = load(points, i), load(normals, i), load(viewers, i)
        total = triple(row, layout.EMISSION)
        for j in range(len(light_kinds)):
            light, light_row = light_kinds[j], light_rows[j]
            l, _, arriving = incident(light, light_row, p)
            if max(arriving) <= threshold or (light != AMBIENT and dot(n, l) <= 0.0):
                skipped += 1
                continue
            share = triple(row, layout.AMBIENT) if light == AMBIENT else evaluate(kind, row, n, l, v, none)
            total = add(total, (share[0] * arriving[0], share[1] * arriving[1], share[2] * arriving[2]))
        out[i, 0], out[i, 1], out[i, 2] = total
    return skipped


MATERIALS = [
    Lambert(albedo=(0.2, 0.4, 0.6), emission=0.1),
    Phong(k_d=0.4, k_s=0.5, exponent=9),
    CookTorrance(albedo=0.5, k_s=0.4, m=0.3),
    OrenNayar(albedo=0.7, sigma=0.5),
]
LIGHTS = [
    AmbientLight(intensity=(0.1, 0.2, 0.3)),
    PointLight(position=(0, 0, 3), intensity=(5, 6, 7)),
    PointLight(position=(0, 0, 400), intensity=1),
    SpotLight(position=(2, 2, 2), direction=(-1, -1, -1), half_angle=34.4, exponent=2, intensity=9),
    DirectionalLight(direction=(0.3, 0.1, -1), intensity=0.8),
]


def picture(threshold):
    rng = np.random.default_rng(0)
    count = 400
    points = rng.normal(size=(count, 3))
    normals, viewers = rng.normal(size=(2, count, 3))
    for w in (normals, viewers):
        w /= np.linalg.norm(w, axis=1)[:, None]
    viewers *= np.sign(np.sum(viewers * normals, axis=1))[:, None]
    which = rng.integers(0, len(MATERIALS), count)
    out = np.empty((count, 3))
    tables = pack_materials(MATERIALS), pack_lights(LIGHTS)
    skipped = shade(*tables[0], which, points, normals, viewers, *tables[1], threshold, out)
    return which, points, normals, viewers, out, skipped


def test_a_renderer_s_sum_over_lights_and_materials():
    which, points, normals, viewers, out, _ = picture(0.0)
    for i in range(40):
        material = MATERIALS[which[i]]
        k_a = material.k_a or getattr(material, "albedo", None) or material.k_d
        expected = np.array(material.emission) + np.array(k_a) * LIGHTS[0].intensity
        for light in LIGHTS[1:]:
            l, _, rgb = incident(*light.pack(), tuple(points[i]))
            expected = expected + reflect(material, normals[i], l, viewers[i]) * rgb
        np.testing.assert_allclose(out[i], expected, rtol=1e-12)


def test_a_threshold_changes_the_sum_by_no_more_than_it_promises():
    *_, exact, skipped_exactly = picture(0.0)
    *_, coarse, skipped = picture(1e-2)
    assert skipped > skipped_exactly > 0
    difference = np.abs(exact - coarse)
    assert difference.max() > 0
    assert difference.max() <= 5 * 1e-2 * 1.5  # five lights; the lobe of m = .3 stays below 1.5


def test_terms_are_the_body_s_and_the_highlight_s():
    """The diffuse term of a glossy material is that of the same material without its gloss."""
    n, l, v, none = (0.0, 0.0, 1.0), (0.6, 0.0, 0.8), (-0.48, 0.36, 0.8), (0.0, 0.0, 0.0)
    for glossy, matte in (
        (Phong(k_d=0.3, k_s=0.5), Phong(k_d=0.3)),
        (CookTorrance(albedo=0.8, k_s=0.5, m=0.3), Lambert(albedo=0.4)),
    ):
        diffuse, specular = terms(*glossy.pack(), n, l, v, none)
        np.testing.assert_allclose(diffuse, evaluate(*matte.pack(), n, l, v, none), rtol=1e-14)
        np.testing.assert_allclose(add(diffuse, specular), evaluate(*glossy.pack(), n, l, v, none))
        assert min(specular) > 0


def test_materials_and_lights_are_declared_without_compiling():
    code = (
        "import sys; import raytrace as m, raytrace.brdf.registry, raytrace.materials.reflect; "
        "import raytrace.lights.sources, raytrace.image.write; "
        "raytrace.brdf.registry.reflection_models(); "
        "m.CookTorrance(albedo=.5, m=.2).pack(); m.PoulinFournier(k_d=.5).pack(); "
        "print([x for x in ('numba', 'OpenImageIO', 'scipy', 'embreex') if x in sys.modules])"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"
