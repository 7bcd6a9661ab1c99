"""`obscurance materials`: the presets; measured albedo, reciprocity and fit error of materials."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from raytrace import PRESETS, OrenNayar, material_from_dict
from raytrace.brdf.oren_nayar import fitted_orders, reference_orders
from raytrace.errors import OptionError, nearest_name
from raytrace.materials import reflect
from raytrace.materials.base import BaseMaterial, Brushed
from raytrace.materials.reflect import NORMAL, asymmetry, towards
from raytrace.types import Float64s

from ..formats.table import endings

ANGLES = (0, 20, 40, 60, 75, 85, 89)  # degrees from the normal
_RECIPROCAL = 1e-6
_ORDER = 384  # of the quadrature: narrow highlights of empirical models want many points
_FIT_ANGLES, _FIT_TURNS, _FIT_ORDER = (5, 30, 55, 75), (0, 60, 120, 180), 64
_CHANNELS = ("red", "green", "blue")
_SCENES = (".toml", *endings("holds", "scene"))


def presets() -> list[tuple[str, str]]:
    return [(name, _written(values)) for name, values in PRESETS.items()]


def preset_toml(name: str) -> str:
    """A preset as an entry of a scene's `[[materials]]`. Raises: OptionError: there is none of this name."""
    lines = [f"{key} = {_value(value, None)}" for key, value in _preset(name).items()]
    return "\n".join(["[[materials]]", f'name = "my_{name}"', *lines, ""])


def chosen_materials(name: str | None) -> list[tuple[str, BaseMaterial]]:
    """The materials of a preset, of all for None, or of the objects of a scene file. Raises: InputError."""
    if name is None:
        return [(each, material_from_dict({"preset": each})) for each in PRESETS]
    if Path(name).suffix.lower() not in _SCENES:
        return [(name, material_from_dict(_preset(name)))]
    from ..description.read import read_scene

    found: dict[BaseMaterial, list[str]] = {}
    for item in read_scene(name).scene.objects:
        found.setdefault(item.shape.material, []).append(item.name)
    return [(", ".join(names[:3]) + (", …" if len(names) > 3 else ""), material) for material, names in found.items()]


def check(name: str, material: BaseMaterial) -> str:
    """Albedo by angle of incidence and reciprocity of a material; of an Oren–Nayar one also how far the fit is off.

    The albedo is the part of the light arriving from one direction that is reflected: physical models must not exceed
    1. Empirical models reflect light of intensity 1 where physical ones want π, so theirs is divided by π.
    """
    lines = [f"{name}: {_written(material.to_dict())}"]
    lines.append("  albedo at      " + "".join(f"{f'{angle}°':>7}" for angle in ANGLES))
    turned = {"": material}
    if isinstance(material, Brushed):
        turned = {"along ": replace(material, grain=(1.0, 0, 0)), "across ": replace(material, grain=(0, 1.0, 0))}
    for title, oriented in turned.items():
        values = np.array([albedo(oriented, np.radians(angle)) for angle in ANGLES])
        grey = bool(np.ptp(values, axis=1).max() < 1e-4)
        for channel, column in zip(("all",) if grey else _CHANNELS, values.T, strict=False):
            lines.append(f"    {title + channel:<13}" + "".join(f"{value:7.3f}" for value in column))
    apart = asymmetry(material)
    verdict = "reciprocal" if apart < _RECIPROCAL else "not reciprocal"
    lines.append(f"  |f(l, v) − f(v, l)| / larger: at most {apart:.1e}, {verdict}")
    if isinstance(material, OrenNayar) and material.sigma > 0:
        for title, turn in (("back to the light", 0.0), ("away from it", np.pi)):
            rows = [_fit(material, towards(angle), towards(angle, turn)) for angle in np.radians(ANGLES)]
            lines.append(f"  f in parts of ρ/π, seen {title} at the same angle")
            for curve, column in zip(("fit", "integral"), np.array(rows).T, strict=True):
                lines.append(f"    {curve:<13}" + "".join(f"{value:7.3f}" for value in column))
        rms, largest = fit_error(material)
        lines.append(f"    fit minus integral, directions to 75°: {rms:.3f} RMS, {largest:.3f} largest")
    return "\n".join(lines)


def albedo(material: BaseMaterial, incidence: float) -> Any:
    """∫ f cosθ_v dω (3,) for light at `incidence` radians: the part of it that is reflected."""
    return reflect.albedo(material, incidence, _ORDER) / (1.0 if material.physical else np.pi)


def fit_error(material: OrenNayar) -> tuple[float, float]:
    """Root mean square and largest difference of fit and integral (`reference_orders`), in parts of ρ/π."""
    angles, turns = np.radians(_FIT_ANGLES), np.radians(_FIT_TURNS)
    pairs = [_fit(material, towards(l), towards(v, turn), _FIT_ORDER) for l in angles for v in angles for turn in turns]
    errors = np.subtract(*np.transpose(pairs))
    return float(np.sqrt(np.mean(np.square(errors)))), float(np.abs(errors).max())


def _fit(material: OrenNayar, l: Float64s, v: Float64s, *order: int) -> list[float]:
    """The model's f, and the integral that it fits, in parts of ρ/π."""
    fit = fitted_orders(material.sigma, tuple(NORMAL), tuple(l), tuple(v))
    exact = reference_orders(material.sigma, l, v, *order)
    return [(first + np.mean(material.albedo) * second) / l[2] for first, second in (fit, exact)]


def _preset(name: str) -> dict[str, Any]:
    if name not in PRESETS:
        expected = "a scene file or one of " + ", ".join(sorted(PRESETS))
        raise OptionError("name", expected, name, nearest=nearest_name(name, PRESETS))
    return PRESETS[name]


def _written(values: dict[str, Any]) -> str:
    return ", ".join(f"{key} = {_value(value)}" for key, value in values.items())


def _value(value: Any, digits: int | None = 5) -> str:
    """A value as TOML has it, one number for three equal ones. Args: digits: None: the shortest exact form."""
    if isinstance(value, list | tuple):
        parts = [_value(each, digits) for each in value]
        return parts[0] if len(set(parts)) == 1 else f"[{', '.join(parts)}]"
    if isinstance(value, float) and digits:
        return f"{value:.{digits}g}"
    return f'"{value}"' if isinstance(value, str) else str(value)
