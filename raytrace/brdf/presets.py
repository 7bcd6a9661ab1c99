"""Named materials as plain values, each with its source: `material_from_dict({"preset": "gold"})`.

Reflectances are linear, not sRGB-encoded. F0, the reflectance at normal incidence of a metal, becomes the index η that
has it (Cook & Torrance 1982, with extinction zero); an F0 of one is .999.

Metals: N. Hoffman, "Background: Physics and Math of Shading", SIGGRAPH courses 2010–2013, table 1 (linear F0).
What is "chosen" has no source but the eye.
"""

from typing import Any

from ..errors import OptionError, nearest_name
from ..system.parameters import made_of
from .material import Material
from .registry import reflection_models


def eta_from_reflectance(reflectance: float) -> float:
    """Index η of the dielectric that reflects `reflectance` in [0, 1) at normal incidence (Cook & Torrance 1982)."""
    root = reflectance**0.5
    return float((1.0 + root) / (1.0 - root))


def _metal(f0: tuple[float, float, float], **slopes: Any) -> dict[str, Any]:
    """Values of a metal of this reflectance at normal incidence; `slopes`: parameters of its facets."""
    eta = [eta_from_reflectance(min(channel, 0.999)) for channel in f0]
    return {"albedo": 0.0, "k_s": 1.0, "eta": eta, "k_a": list(f0), **slopes}


PRESETS: dict[str, dict[str, Any]] = {
    # Pressed PTFE reflects at least .99 of visible light, nearly as Lambert has it (Weidner & Hsia 1981).
    "white_standard": {"model": "lambert", "albedo": 0.99},
    # A photographer's grey card: 18 % by definition.
    "grey_card": {"model": "lambert", "albedo": 0.18},
    # Clear interface of η = 1.5 over a white body, k_s and slope chosen.
    "plastic": {"model": "cook_torrance", "albedo": 0.8, "k_s": 0.5, "m": 0.15, "eta": 1.5},
    # Blinn–Phong's plastic: a white highlight on a coloured body (12.28); numbers chosen.
    "red_plastic": {"model": "blinn_phong", "k_d": [0.5, 0.02, 0.02], "k_s": 0.4, "exponent": 32.0},
    # Clay is one of the materials Oren & Nayar 1994 measure and render; σ = 30° and a terracotta albedo chosen.
    "clay": {"model": "oren_nayar", "albedo": [0.6, 0.32, 0.21], "sigma": 0.52},
    # So rough that it brightens towards its outline as velvet does; numbers chosen.
    "velvet_clay": {"model": "oren_nayar", "albedo": [0.35, 0.08, 0.12], "sigma": 1.0},
    # Geometric albedo .12 (NASA Moon fact sheet); the full moon's flat disc is Oren & Nayar's example, σ = 40° chosen.
    "moon": {"model": "oren_nayar", "albedo": 0.12, "sigma": 0.7},
    "gold": {"model": "cook_torrance", **_metal((1.0, 0.71, 0.29), m=0.2)},
    "copper": {"model": "cook_torrance", **_metal((0.95, 0.64, 0.54), m=0.25)},
    "silver": {"model": "cook_torrance", **_metal((0.95, 0.93, 0.88), m=0.15)},
    # Slopes chosen for a linear brush finish.
    "brushed_aluminium": {
        "model": "elliptical_beckmann", **_metal((0.91, 0.92, 0.92), m_parallel=0.08, m_perpendicular=0.4),
    },
    # Slopes as Ward measured of rolled brass (1992, table 1: ρ_d .10, ρ_s .33, α .05 and .16); brighter, colour chosen.
    "rolled_brass": {
        "model": "ward", "k_d": [0.16, 0.1, 0.04], "k_s": [0.55, 0.4, 0.2], "m_parallel": 0.05, "m_perpendicular": 0.16,
    },
    # Iron's F0 (Hoffman); heights and lengths of a finely ground face, chosen.
    "ground_iron": {
        "model": "kajiya", "height": 70.0, "correlation_parallel": 6000.0, "correlation_perpendicular": 1400.0,
        "eta": [eta_from_reflectance(channel) for channel in (0.56, 0.57, 0.58)],
    },
    # A clear brushed varnish over a coloured body, in Ashikhmin & Shirley's terms; numbers chosen.
    "brushed_varnish": {
        "model": "ashikhmin_shirley", "albedo": [0.28, 0.09, 0.03], "reflectance": 0.08,
        "exponent_parallel": 800.0, "exponent_perpendicular": 15.0,
    },
    # The textbook chapter's example of an anisotropic reflector: dark rounded lands; numbers chosen.
    "vinyl_record": {
        "model": "poulin_fournier", "k_d": 0.03, "k_s": 0.6, "exponent": 80.0, "spacing": 2.0, "floor": 0.3,
    },
    # A smooth metal in Strauss's own terms; numbers chosen.
    "strauss_copper": {"model": "strauss", "colour": [0.72, 0.35, 0.22], "smoothness": 0.75, "metalness": 0.9},
}  # fmt: skip


def material_from_dict(data: dict[str, Any]) -> Material:
    """A material from plain values: `model` and its fields, or `preset` and the fields to change in it.

    Raises: OptionError naming the material, the field, what is accepted and what came.
    """
    if "preset" in data:
        data = _preset(data["preset"]) | {name: value for name, value in data.items() if name != "preset"}
    return made_of(data, reflection_models(), "model", "material")


def _preset(name: str) -> dict[str, Any]:
    """The plain values of a preset. Raises: OptionError listing the names."""
    if not isinstance(name, str) or name not in PRESETS:
        names = sorted(PRESETS)
        raise OptionError("preset", "one of " + ", ".join(names), name, "material", nearest_name(name, names))
    return dict(PRESETS[name])
