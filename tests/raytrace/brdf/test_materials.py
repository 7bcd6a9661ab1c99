"""Materials: what is accepted, what is refused and how, and the way into and out of files."""

import tomllib
from dataclasses import FrozenInstanceError

import pytest

from obscurance.raytrace import (
    AshikhminShirley,
    BlinnPhong,
    CookTorrance,
    EllipticalBeckmann,
    Kajiya,
    Lambert,
    OrenNayar,
    Phong,
    PoulinFournier,
    Strauss,
    Ward,
    material_from_dict,
)
from obscurance.raytrace.brdf.presets import PRESETS
from obscurance.raytrace.brdf.reflect import reflect
from obscurance.raytrace.errors import OptionError

REFUSED = [
    (lambda: Lambert(albedo=1.2), "Lambert", "albedo[0]", "[0, 1]", 1.2),
    (lambda: Lambert(albedo=(0.1, 0.2, -0.1)), "Lambert", "albedo[2]", "[0, 1]", -0.1),
    (lambda: Lambert(albedo=float("nan")), "Lambert", "albedo[0]", "[0, 1]", None),
    (lambda: Lambert(), "Lambert", "albedo", "a value", "nothing"),
    (lambda: Lambert(albedo=1, shine=3), "Lambert", "shine", "albedo", "an unknown key"),
    (lambda: Phong(k_d=0.7, k_s=0.4), "Phong", "k_d + k_s [0]", "at most 1", "0.7 + 0.4 = 1.1"),
    (lambda: BlinnPhong(k_d=(0, 0, 1), k_s=0.1), "BlinnPhong", "k_d + k_s [2]", "at most 1", None),
    (lambda: Phong(k_d=0.5, exponent=0), "Phong", "exponent", "(0, 1e6]", 0),
    (lambda: PoulinFournier(k_d=0.5, k_s=0.6), "PoulinFournier", "k_d + k_s [0]", "at most 1", None),
    (lambda: PoulinFournier(k_d=0.5, floor=1.1), "PoulinFournier", "floor", "[0, 1]", 1.1),
    (lambda: CookTorrance(albedo=0.5, m=0), "CookTorrance", "m", "[1e-6, 100]", 0),
    (lambda: CookTorrance(albedo=0.5, m=0.1, eta=0.9), "CookTorrance", "eta[0]", "[1, 1e6]", 0.9),
    (lambda: CookTorrance(albedo=0.5, m=0.1, k_s=1.5), "CookTorrance", "k_s", "[0, 1]", 1.5),
    (lambda: CookTorrance(albedo=0.5, m=0.1, gaussian_c=1), "CookTorrance", "gaussian_c", "gaussian", "beckmann"),
    (lambda: EllipticalBeckmann(albedo=0, m_parallel=0.1, m_perpendicular=-1), "EllipticalBeckmann",
     "m_perpendicular", "[1e-6, 100]", -1),
    (lambda: Ward(k_d=0.6, k_s=0.5, m_parallel=1, m_perpendicular=1), "Ward", "k_d + k_s [0]", "at most 1", None),
    (lambda: Ward(k_d=0.6, m_parallel=1, m_perpendicular=1, form="own"), "Ward", "form", "duer", "own"),
    (lambda: AshikhminShirley(albedo=0.6, exponent_parallel=0, exponent_perpendicular=1), "AshikhminShirley",
     "exponent_parallel", "(0, 1e6]", 0),
    (lambda: Kajiya(height=50, correlation_parallel=600, correlation_perpendicular=900), "Kajiya",
     "correlation_parallel", "at least the longest wavelength and twice the height, 611 nm", 600),
    (lambda: Kajiya(height=500, correlation_parallel=2e3, correlation_perpendicular=900), "Kajiya",
     "correlation_perpendicular", "twice the height, 1000 nm", 900),
    (lambda: Kajiya(height=0, correlation_parallel=2e3, correlation_perpendicular=900), "Kajiya", "height", "[0.001",
     0),
    (lambda: OrenNayar(albedo=0.5, sigma=2), "OrenNayar", "sigma", "radians in [0, π/2]", 2),
    (lambda: Strauss(colour=0.5, smoothness=1), "Strauss", "smoothness", "[0, 1)", 1),
    (lambda: Strauss(colour=0.5, smoothness=0.5, metalness="shiny"), "Strauss", "metalness", "number", '"shiny"'),
    (lambda: material_from_dict({"model": "marble"}), "material", "model", "lambert", "marble"),
    (lambda: material_from_dict({"albedo": 1}), "material", "model", "a value", "nothing"),
    (lambda: material_from_dict({"model": "phong", "k_d": 2}), "Phong", "k_d[0]", "[0, 1]", 2),
    (lambda: material_from_dict({"preset": "unobtainium"}), "material", "preset", "gold", "unobtainium"),
    (lambda: material_from_dict({"preset": "clay", "sigma": -1}), "OrenNayar", "sigma", "radians in [0, π/2]", -1),
]  # fmt: skip


@pytest.mark.parametrize(("make", "source", "field", "expected", "got"), REFUSED)
def test_a_wrong_value_is_named(make, source, field, expected, got):
    with pytest.raises(OptionError) as caught:
        make()
    error = caught.value
    assert (error.source, error.field) == (source, field)
    assert expected in error.expected
    assert got is None or error.got == got
    assert "\n" not in str(error)


def test_coefficients_may_sum_to_one_in_floating_point():
    for tenths in range(11):
        Phong(k_d=tenths / 10, k_s=1 - tenths / 10)


ONE_OF_EACH = [
    Lambert(albedo=0.25, emission=(1, 0, 0), two_sided=True),
    Phong(k_d=(0.1, 0.2, 0.3), k_s=0.5, exponent=7, weight="cosine"),
    BlinnPhong(k_d=0.2, k_a=0.9),
    CookTorrance(albedo=0.2, m=0.3, distribution="gaussian", gaussian_c=2, colour=(1, 0.5, 0), form="book"),
    EllipticalBeckmann(albedo=0.2, m_parallel=0.3, m_perpendicular=0.1, grain=(0, 1, 0), eta=(1, 2, 3)),
    Ward(k_d=0.2, k_s=0.3, m_parallel=0.3, m_perpendicular=0.1, grain=(0, 1, 0), form="duer"),
    AshikhminShirley(albedo=0.2, reflectance=(0.3, 0.2, 0.1), exponent_parallel=3, exponent_perpendicular=1),
    Kajiya(height=50, correlation_parallel=700, correlation_perpendicular=900, wavelengths=(600, 500, 400)),
    OrenNayar(albedo=0.2, sigma=0.3),
    Strauss(colour=0.2, smoothness=0.3, metalness=0.4, transparency=0.5),
    PoulinFournier(k_d=0.2, k_s=0.3, exponent=9, spacing=3, floor=0.1, grain=(0, 1, 0)),
]


@pytest.mark.parametrize("material", ONE_OF_EACH, ids=lambda m: m.model)
def test_round_trip_through_toml(material):
    values = material.to_dict()
    toml = "\n".join(f"{name} = {str(value).lower() if isinstance(value, bool) else repr(value)}"
                     for name, value in values.items())  # fmt: skip
    assert material_from_dict(tomllib.loads(toml)) == material


@pytest.mark.parametrize("name", PRESETS)
def test_presets_are_valid_and_reflect(name):
    material = material_from_dict({"preset": name})
    light = reflect(material, [0, 0, 1], [0.3, 0, 1], [-0.3, 0, 1], grain=[1, 0, 0])
    assert (light > 0).all()
    assert material_from_dict(material.to_dict()) == material


def test_preset_with_a_change():
    assert material_from_dict({"preset": "moon", "sigma": 0.1}).sigma == 0.1


def test_materials_are_immutable():
    with pytest.raises(FrozenInstanceError):
        Lambert(albedo=0.5).albedo = (0, 0, 0)
