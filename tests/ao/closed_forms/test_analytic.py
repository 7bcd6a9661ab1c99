"""The closed forms against quasi-Monte-Carlo integration of their scenes, published numbers and one another."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import acos, cos, inf, log, pi, sin, sqrt, tan

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import expn, iti0k0
from scipy.stats import qmc

from obscurance.ao import closed_forms as analytic
from obscurance.ao.closed_forms import bickley, polygon_form_factor, shell

Distance = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def cosine_directions(log2_count: int = 17) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    u, v = qmc.Sobol(2, rng=7).random_base2(log2_count).T
    r, phi = np.sqrt(u), 2 * np.pi * v
    return r * np.cos(phi), r * np.sin(phi), np.sqrt(1 - u)


X, Y, Z = cosine_directions()


def integrated(distance: Distance, tau: analytic.Rate, max_distance: float) -> float:
    with np.errstate(divide="ignore", invalid="ignore"):
        d = distance(X, Y, Z)
    if tau is None:
        return float((d >= max_distance).mean())
    near = d < max_distance
    mu = np.ones_like(d)
    if isinstance(tau, str):
        t = d[near] / max_distance
        mu[near] = t if tau == "linear" else t * t * (3 - 2 * t)
        return float(mu.mean())
    mu[near] = (1 - np.exp(-tau * d[near])) / (1 - np.exp(-tau * max_distance))
    return float(mu.mean())


def horizontal(height: float, radius: float = inf) -> Distance:
    return lambda x, y, z: np.where(np.hypot(x, y) * height / z < radius, height / z, inf)


def upright(direction: tuple[float, float], distance: float, height: float = inf) -> Distance:
    def hit(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        d = distance / (x * direction[0] + y * direction[1])
        return np.where((d > 0) & (d * z < height), d, inf)

    return hit


def nearest(*parts: Distance) -> Distance:
    return lambda x, y, z: np.minimum.reduce([part(x, y, z) for part in parts])


def ball(radius: float, centre: tuple[float, float, float], axes: tuple[int, int, int] = (1, 1, 1)) -> Distance:
    """A sphere, or with a zero in `axes` the cylinder along that axis; its far side from within."""

    def hit(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        weights = np.array(axes, dtype=float)
        direction = np.stack([x, y, z], axis=-1)
        a = (direction**2) @ weights
        b = direction @ (weights * centre)
        c = (np.array(centre) ** 2) @ weights - radius**2
        disc = b * b - a * c
        root = np.sqrt(np.maximum(disc, 0))
        t = (b - root) / a if c > 1e-12 else (b + root) / a
        return np.where((disc > 0) & (t > 0), t, inf)

    return hit


def leaning(angle: float, distance: float) -> Distance:
    """Half-plane through the edge at x = −distance, at interior angle `angle` to the floor."""

    def hit(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        n = (-sin(angle), cos(angle))
        t = -distance * n[0] / (x * n[0] + z * n[1])
        along = (distance + t * x) * cos(angle) + t * z * sin(angle)
        return np.where((t > 0) & (along > 0), t, inf)

    return hit


def walls(a: float, b: float, c: float, d: float, height: float) -> Distance:
    sides = [upright(n, s) for n, s in zip([(1, 0), (0, 1), (-1, 0), (0, -1)], (a, b, c, d), strict=True)]
    return nearest(horizontal(height), *sides)


SCENES: dict[str, tuple[Callable[[float | None, float], float], Distance, bool]] = {
    "dome": (lambda t, D: analytic.dome(0.7, t, D), ball(0.7, (0, 0, 0)), True),
    "ceiling": (lambda t, D: analytic.ceiling(0.6, t, D), horizontal(0.6), True),
    "disk": (lambda t, D: analytic.disk(0.6, 0.9, t, D), horizontal(0.6, 0.9), True),
    "wall": (lambda t, D: analytic.wall(0.5, 1.2, t, D), upright((1, 0), 0.5, 1.2), True),
    "low wall": (lambda t, D: analytic.wall(0.5, 0.2, t, D), upright((1, 0), 0.5, 0.2), True),
    "infinite wall": (lambda t, D: analytic.wall(0.5, inf, t, D), upright((1, 0), 0.5), True),
    "trench": (
        lambda t, D: analytic.trench(0.4, 0.8, 0.6, t, D),
        nearest(upright((1, 0), 0.4, 0.6), upright((-1, 0), 0.8, 0.6)),
        True,
    ),
    "corner": (lambda t, D: analytic.corner(0.4, 0.7, t), nearest(upright((1, 0), 0.4), upright((0, 1), 0.7)), False),
    "acute groove": (lambda t, D: analytic.groove(0.8, 0.5, t), leaning(0.8, 0.5), False),
    "obtuse groove": (lambda t, D: analytic.groove(2.1, 0.5, t), leaning(2.1, 0.5), False),
    "sphere": (lambda t, D: analytic.sphere(0.8, 1.0, 0.0, t), ball(0.8, (0, 0, 1.0)), False),
    "sphere aside": (lambda t, D: analytic.sphere(0.8, 0.8, 0.9, t), ball(0.8, (0.9, 0, 0.8)), False),
    "inside sphere": (lambda t, D: analytic.inside_sphere(0.5, t), ball(0.5, (0, 0, 0.5)), False),
    "inside cylinder": (lambda t, D: analytic.inside_cylinder(0.5, t), ball(0.5, (0, 0, 0.5), (1, 0, 1)), False),
    "cylinder": (lambda t, D: analytic.cylinder(0.5, 0.6, 0.0, t), ball(0.5, (0, 0, 0.6), (1, 0, 1)), False),
    "cylinder aside": (lambda t, D: analytic.cylinder(0.5, 0.5, -0.7, t), ball(0.5, (0.7, 0, 0.5), (1, 0, 1)), False),
    "cube": (lambda t, D: analytic.box((0.5, 0.5, 0.5, 0.5), 1.0, t, D), walls(0.5, 0.5, 0.5, 0.5, 1.0), True),
    "flat box": (lambda t, D: analytic.box((0.2, 0.5, 0.9, 0.3), 0.4, t, D), walls(0.2, 0.5, 0.9, 0.3, 0.4), True),
}


CASES = [(name, limit) for name, scene in SCENES.items() for limit in ((inf, 0.55, 1.3, 3.0) if scene[2] else (inf,))]


@pytest.mark.parametrize("tau", [None, 0.4, 3.0])
@pytest.mark.parametrize(("name", "limit"), CASES)
def test_matches_quasi_monte_carlo(name: str, limit: float, tau: float | None) -> None:
    closed_form, distance, _ = SCENES[name]
    tolerance = 4e-4 if tau is None else 1.5e-4
    assert closed_form(tau, limit) == pytest.approx(integrated(distance, tau, limit), abs=tolerance)


@pytest.mark.parametrize("form", ["linear", "smooth"])
@pytest.mark.parametrize(("name", "limit"), [(name, limit) for name, limit in CASES if limit < inf])
def test_polynomials_match_quasi_monte_carlo(name: str, limit: float, form: str) -> None:
    closed_form, distance, _ = SCENES[name]
    assert closed_form(form, limit) == pytest.approx(integrated(distance, form, limit), abs=1.5e-4)


def test_published_values() -> None:
    cube = (0.5, 0.5, 0.5, 0.5)
    assert analytic.box(cube, 1.0, 1.0) == pytest.approx(0.553728, abs=5e-7)
    assert analytic.box(cube, 1.0, 5.0) == pytest.approx(0.975138, abs=5e-7)
    assert analytic.ceiling(1.0, max_distance=2.0) == pytest.approx(0.25, abs=1e-15)
    assert analytic.ceiling(1.0, 1.0) == pytest.approx(1 - 2 * expn(3, 1.0), abs=1e-15)
    assert analytic.wall(1.0, 2.0) == pytest.approx(0.5 * (1 + 1 / sqrt(5)), abs=1e-15)
    assert analytic.disk(1.0, 1.0) == pytest.approx(0.5, abs=1e-15)
    assert analytic.disk(1.0, 0.5, spread=90) == pytest.approx(0.6, abs=1e-15)
    assert analytic.tilted_normal(pi / 3) == pytest.approx(0.75, abs=1e-15)


@pytest.mark.parametrize("slope", [0.2, 0.7, 2.0])
@pytest.mark.parametrize("sides", [3, 4, 7, 4096])
def test_an_inverted_pyramid(sides: int, slope: float) -> None:
    """(1/2π) ∫ cos² h dφ, where a side towards φ = 0 has the horizon tan h = t cosφ; from far away a cone's cos² β."""
    horizon = quad(lambda phi: 1 / (1 + (slope * cos(phi)) ** 2), -pi / sides, pi / sides, epsabs=1e-14)[0]
    assert analytic.inverted_pyramid(sides, slope) == pytest.approx(sides * horizon / (2 * pi), abs=1e-12)
    if sides == 4096:
        assert analytic.inverted_pyramid(sides, slope) == pytest.approx(1 / (1 + slope**2), abs=1e-6)


@pytest.mark.parametrize("tau", [None, 1.3])
@pytest.mark.parametrize("spread", [150, 80])
def test_a_disk_in_a_cone(tau: float | None, spread: float) -> None:
    within = cos(np.radians(spread / 2)) < Z
    d = horizontal(0.6, 0.9)(X, Y, Z)[within]
    mean = np.mean(np.isinf(d) if tau is None else -np.expm1(-tau * d))
    assert analytic.disk(0.6, 0.9, tau, spread=spread) == pytest.approx(mean, abs=1e-3)


@pytest.mark.parametrize("tau", [0.05, 1.0, 8.0])
def test_other_forms_of_the_same_integral(tau: float) -> None:
    d, h = 0.7, 1.1
    infinite = 1 - 2 / pi * (bickley(1, tau * d) - bickley(3, tau * d))
    assert analytic.wall(d, inf, tau) == pytest.approx(float(infinite), abs=1e-10)

    def strip(a: float) -> float:
        return np.exp(-tau * d / cos(a)) * sin(a) ** 2 * (1 - sqrt(1 - min(1.0, h / d / tan(a)) ** 2))

    kink = np.arctan(h / d)
    finite = 1 - 2 / pi * (quad(strip, 0, kink, epsabs=1e-12)[0] + quad(strip, kink, pi / 2, epsabs=1e-12)[0])
    assert analytic.wall(d, h, tau) == pytest.approx(finite, abs=1e-9)
    assert analytic.groove(pi / 2, d, tau) == pytest.approx(analytic.wall(d, inf, tau), abs=1e-10)
    assert analytic.corner(d, 1e6, tau) == pytest.approx(analytic.wall(d, inf, tau), abs=1e-10)
    assert analytic.box((1e3, 1e3, 1e3, 1e3), h, tau) == pytest.approx(analytic.ceiling(h, tau), abs=1e-10)
    assert analytic.cylinder(d, d, 0.0, tau) < analytic.sphere(d, d, 0.0, tau)


def test_other_forms_of_linear_attenuation() -> None:
    assert analytic.dome(0.6, "linear", 2.0) == pytest.approx(0.3, abs=1e-15)
    assert analytic.ceiling(0.5, "linear", 2.0) == pytest.approx(1 - (1 - 0.5 / 2.0) ** 2, abs=1e-15)
    far = sqrt(0.5**2 + 0.7**2)
    disk = 0.5**2 / far**2 + 2 * 0.5 / 2.0 * (1 - 0.5 / far)
    assert analytic.disk(0.5, 0.7, "linear", 2.0) == pytest.approx(disk, abs=1e-15)
    c, beta = 0.35, acos(0.35)
    wall = 1 - (beta - 2 * c * np.arctanh(sin(beta)) + c * c * tan(beta)) / pi
    assert analytic.wall(0.7, inf, "linear", 2.0) == pytest.approx(wall, abs=1e-10)
    for scene in (partial(analytic.wall, 0.5, 0.9), partial(analytic.box, (0.2, 0.5, 0.9, 0.3), 0.4)):
        assert scene("linear", 0.8) == pytest.approx(scene(1e-4, 0.8), abs=2e-5)  # its limit for τ → 0


@pytest.mark.parametrize("closed_form", [
    lambda t: analytic.wall(0.5, 1.2, t), lambda t: analytic.trench(0.4, 0.8, 0.6, t),
    lambda t: analytic.corner(0.4, 0.7, t), lambda t: analytic.groove(0.8, 0.5, t),
    lambda t: analytic.sphere(0.8, 0.9, 0.3, t),
    lambda t: analytic.inside_sphere(0.5, t), lambda t: analytic.inside_cylinder(0.5, t),
    lambda t: analytic.cylinder(0.5, 0.6, 0.2, t), lambda t: analytic.box((0.2, 0.5, 0.9, 0.3), 0.4, t),
])  # fmt: skip
def test_small_rate_leaves_the_binary_form(closed_form: Callable[[float | None], float]) -> None:
    assert closed_form(1e-6) == pytest.approx(closed_form(None), abs=1e-4)


def test_distance_limits_far_away_change_nothing() -> None:
    assert analytic.box((0.2, 0.5, 0.9, 0.3), 0.4, 30.0, 5.0) == pytest.approx(
        analytic.box((0.2, 0.5, 0.9, 0.3), 0.4, 30.0), abs=1e-10
    )
    assert analytic.wall(0.5, 1.2, max_distance=0.4) == 1.0
    assert analytic.ceiling(1.0, 2.0, max_distance=0.9) == 1.0


@pytest.mark.parametrize("x", [1e-3, 0.5, 3.0, 40.0])
def test_bickley(x: float) -> None:
    assert bickley(1, x) == pytest.approx(pi / 2 - iti0k0(x)[1], abs=1e-12)  # Ki1' = −K0, DLMF 10.43.11
    for n in (1, 2, 3):
        direct = quad(lambda a, n=n: np.exp(-x / cos(a)) * cos(a) ** (n - 1), 0, pi / 2, epsabs=1e-12, limit=400)[0]
        assert bickley(n, x) == pytest.approx(direct, abs=1e-9)


def test_bickley_at_zero() -> None:
    assert bickley(1, 0.0) == pytest.approx(pi / 2, abs=1e-13)
    assert bickley(3, 0.0) == pytest.approx(pi / 4, abs=1e-13)


def test_shell_is_the_integral_it_names() -> None:
    for n in range(4):
        direct = quad(lambda t, n=n: t**n * 0.5**2 / t**3, 0.5, 2.0, epsabs=1e-13)[0]
        assert shell(0.0, 0.5, 2.0, n) == pytest.approx(direct, abs=1e-12)
    for tau, near, far in [(0.0, 0.5, 2.0), (1.5, 0.5, 2.0), (4.0, 0.1, 0.11)]:
        direct = quad(lambda t, tau=tau, near=near: np.exp(-tau * t) * near**2 / t**3, near, far, epsabs=1e-13)[0]
        assert shell(tau, near, far) == pytest.approx(direct, abs=1e-12)
    assert shell(2.0, 1.0, inf) == pytest.approx(expn(3, 2.0), abs=1e-15)


def test_arguments_out_of_range_are_refused() -> None:
    for call in (
        lambda: analytic.ceiling(0.0), lambda: analytic.ceiling(1.0, tau=0.0), lambda: analytic.ceiling(1.0, "linear"),
        lambda: analytic.corner(1.0, 1.0, "smooth"), lambda: analytic.ceiling(1.0, 1.0, -1.0),
        lambda: analytic.sphere(2.0, 1.0), lambda: analytic.cylinder(2.0, 1.0), lambda: analytic.groove(4.0, 1.0),
        lambda: analytic.tilted_normal(4.0), lambda: analytic.inverted_pyramid(2, 1.0),
        lambda: analytic.inverted_pyramid(4, 0.0), lambda: analytic.wall(-1.0), lambda: analytic.box((1, 1, 1, 0), 1.0),
        lambda: analytic.corner(0.0, 1.0), lambda: analytic.inside_sphere(0.0), lambda: analytic.inside_cylinder(0.0),
    ):  # fmt: skip
        with pytest.raises(ValueError, match="expected"):
            call()


def covered(polygon: np.ndarray, normal: np.ndarray) -> float:
    """Part of the cosine-weighted hemisphere about `normal` within the triangle's cone, by quasi-Monte-Carlo."""
    side = np.cross(normal, [1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    directions = np.stack([X, Y, Z], axis=-1) @ np.stack([side, np.cross(normal, side), normal])
    planes = np.cross(polygon, np.roll(polygon, -1, axis=0))
    inside = directions @ planes.T * np.sign(np.linalg.det(polygon)) > 0
    return float(inside.all(axis=1).mean())


def test_polygon_form_factor_matches_quasi_monte_carlo() -> None:
    rng = np.random.default_rng(5)
    below = 0
    for _ in range(20):
        triangle, normal = rng.normal(size=(3, 3)), rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        below += 0 < (triangle @ normal < 0).sum() < 3
        point = rng.normal(size=3)
        assert polygon_form_factor(triangle + point, point, 3 * normal) == pytest.approx(
            covered(triangle, normal), abs=5e-4
        )
    assert below > 5


def test_polygon_form_factor_of_known_shapes() -> None:
    up, origin = np.array([0.0, 0.0, 1.0]), np.zeros(3)
    angles = 2 * pi * np.arange(4096) / 4096
    ring = np.stack([np.cos(angles), np.sin(angles), np.ones(4096)], axis=-1)
    assert 1 - polygon_form_factor(ring, origin, up) == pytest.approx(analytic.disk(1.0, 1.0), abs=1e-6)
    side = [(0.5, -1e7, -1e7), (0.5, 1e7, -1e7), (0.5, 1e7, 1e7), (0.5, -1e7, 1e7)]
    assert polygon_form_factor(side, origin, up) == pytest.approx(0.5, abs=1e-6)
    assert polygon_form_factor([(1, 0, -1), (0, 1, -1), (-1, -1, -1)], origin, up) == 0.0
    closed = sum(
        polygon_form_factor(face, origin, up)
        for face in (
            [(1, -1, 0), (1, 1, 0), (1, 1, 2), (1, -1, 2)], [(-1, -1, 0), (-1, 1, 0), (-1, 1, 2), (-1, -1, 2)],
            [(-1, 1, 0), (1, 1, 0), (1, 1, 2), (-1, 1, 2)], [(-1, -1, 0), (1, -1, 0), (1, -1, 2), (-1, -1, 2)],
            [(-1, -1, 2), (1, -1, 2), (1, 1, 2), (-1, 1, 2)],
        )
    )  # fmt: skip
    assert closed == pytest.approx(1.0, abs=1e-14)


def test_dome_half_distance() -> None:
    assert analytic.dome(2.0, log(2) / 2.0) == pytest.approx(0.5, abs=1e-15)
    assert acos(2 * analytic.tilted_normal(0.3) - 1) == pytest.approx(0.3)
