"""Bakes under faces with alpha, against form factors and against a sum over directions that knows only planes."""

import pickle
from dataclasses import replace

import numpy as np
import PIL.Image
import pytest
from interrupted_bakes import OPTIONS, bake, bits, interrupted
from leaf_cards import FLOOR, FLOOR_FACES, HALVES, HEIGHT, SQUARE, UP, form_factors, leaf_codes
from slow_rays import by_every_triangle, traced_by

from obscurance import ao
from obscurance.ao.closed_forms import polygon_form_factor
from obscurance.ao.options import Options
from obscurance.ao.prepared import Prepared
from obscurance.raytrace import AlphaSurface, Lambert, Mesh, Object, Opacity, Scene, Shape, Texture
from obscurance.raytrace.sampling import GOLDEN

pytestmark = pytest.mark.usefixtures("w_alone")

RAYS = {"samples": 4096, "denoise": False}


def leaf_texture(folder, alpha=1.0):
    PIL.Image.fromarray(leaf_codes(alpha)).save(folder / "leaf.png")
    return Texture(folder / "leaf.png", wrap="clamp_to_edge")


def over_floor(*layers):
    """A floor with unit squares over it. Args: layers: heights, half sides and surfaces, None for an opaque one."""
    vertices, faces, of, surfaces = [FLOOR], [FLOOR_FACES], [np.full(len(FLOOR_FACES), -1)], []
    for height, half, surface in layers:
        faces.append(HALVES + sum(map(len, vertices)))
        vertices.append(np.column_stack([2 * half * SQUARE, np.full(4, height)]))
        of.append(np.full(2, -1 if surface is None else len(surfaces)))
        surfaces += [] if surface is None else [surface]
    faces = np.concatenate(faces)
    uv = np.zeros((len(faces), 3, 2))
    uv[len(FLOOR_FACES) :] = np.tile((SQUARE + 0.5)[HALVES], (len(layers), 1, 1))
    return Mesh(np.concatenate(vertices), faces, opacity=Opacity(np.concatenate(of), tuple(surfaces), uv))


def w_of_planes(layers, mu, count=40_000):
    """w of the floor by a sum over directions: layers are planes, whose alpha is a function of x and y, from below."""
    number = np.arange(count)
    radius, turn = np.sqrt((number + 0.5) / count), 2 * np.pi * number * GOLDEN
    up = np.sqrt(1 - radius**2)
    found = []
    for point in FLOOR:
        left, value = np.ones(count), np.zeros(count)
        for height, alpha in layers:
            distance = height / up
            a = alpha(point[0] + distance * radius * np.cos(turn), point[1] + distance * radius * np.sin(turn))
            value += left * a * mu(distance)
            left = left * (1 - a)
        found.append(np.mean(value + left))
    return np.array(found)


def square_of(alpha, half=0.5, right=np.inf):
    return lambda x, y: alpha * ((abs(x) < half) & (abs(y) < half) & (x < right))


def floor_w(mesh, falloff=None, **options):
    return ao.bake(mesh, falloff or ao.Binary(), **(RAYS | options)).w[: len(FLOOR)]


CARDS = {
    "cut out by half": (lambda folder: AlphaSurface(texture=leaf_texture(folder), cutoff=0.5), 1.0, 0.0),
    "blended by a texture": (lambda folder: AlphaSurface(texture=leaf_texture(folder, 0.6)), 0.6, 0.0),
    "blended by a factor": (lambda folder: AlphaSurface(0.3), 0.3, None),
    "not there": (lambda folder: AlphaSurface(0.0), 0.0, None),
    "below the cutoff": (lambda folder: AlphaSurface(0.3, cutoff=0.5), 0.0, None),
    "above the cutoff": (lambda folder: AlphaSurface(0.5, cutoff=0.5), 1.0, None),
}


@pytest.mark.parametrize("card", CARDS)
def test_a_card_over_a_floor_occludes_by_its_alpha(tmp_path, card):
    surface, alpha, right = CARDS[card]
    w = floor_w(over_floor((HEIGHT, 0.5, surface(tmp_path))))
    assert np.allclose(w, 1 - alpha * form_factors(HEIGHT, right=right), atol=0.01)


def test_layers_count_by_their_distance(tmp_path):
    leaf = AlphaSurface(texture=leaf_texture(tmp_path, 0.8))
    mesh = over_floor((1.0, 1.2, None), (0.3, 0.5, leaf), (0.6, 0.7, AlphaSurface(0.4)))
    layers = [(0.3, square_of(0.8, right=0)), (0.6, square_of(0.4, 0.7)), (1.0, square_of(1.0, 1.2))]
    expected = w_of_planes(layers, lambda distance: 1 - np.exp(-1.5 * distance))
    w = floor_w(mesh, ao.Exponential(tau=1.5))
    assert np.allclose(w, expected, atol=0.01)
    assert abs(w - floor_w(replace(mesh, opacity=None), ao.Exponential(tau=1.5))).max() > 0.1


def test_more_layers_than_a_ray_has_room_for():
    heights = 0.2 + 0.05 * np.arange(12)
    mesh = over_floor(*((height, 0.8, AlphaSurface(0.2)) for height in heights[::-1]))
    expected = w_of_planes([(height, square_of(0.2, 0.8)) for height in heights], lambda x: 1 - np.exp(-2 * x))
    assert np.allclose(floor_w(mesh, ao.Exponential(tau=2.0)), expected, atol=0.01)


@pytest.mark.parametrize("falloff", [ao.Binary(), ao.Exponential(half_distance=0.5)])
def test_every_triangle_in_double_precision_says_the_same(tmp_path, falloff):
    rng = np.random.default_rng(3)
    corners = rng.uniform(-1, 1, (60, 1, 3)) + rng.normal(0, 0.4, (60, 3, 3))
    surfaces = AlphaSurface(0.35), AlphaSurface(texture=leaf_texture(tmp_path), cutoff=0.5), AlphaSurface(1.0)
    opacity = Opacity(np.arange(60) % 4 - 1, surfaces, rng.uniform(0, 1, (60, 3, 2)))
    mesh = Mesh(corners.reshape(-1, 3), np.arange(180).reshape(-1, 3), opacity=opacity)
    walked = ao.bake(mesh, falloff, 64, denoise=False)
    with traced_by(by_every_triangle):
        slowly = ao.bake(mesh, falloff, 64, denoise=False)
    assert np.allclose(walked.w, slowly.w, atol=2e-4)
    assert np.allclose(walked.bent_normals, slowly.bent_normals, atol=1e-3)
    assert np.allclose(walked.error, slowly.error, atol=1e-3)


def test_the_other_ways_of_a_bake(tmp_path):
    leaf = AlphaSurface(texture=leaf_texture(tmp_path), cutoff=0.5)
    mesh = over_floor((HEIGHT, 0.5, leaf))
    expected = 1 - form_factors(HEIGHT, right=0.0)
    assert np.allclose(ao.bake(mesh, ao.Binary(), tolerance=0.005).w[: len(FLOOR)], expected, atol=0.02)
    shapes = Shape(Mesh(FLOOR, FLOOR_FACES), Lambert(albedo=0.5)), _card(leaf)
    scene = Scene(tuple(Object(shape) for shape in shapes)).flattened()
    assert np.allclose(floor_w(scene), expected, atol=0.01)
    surface = ao.bake(mesh, ao.Binary(), 4096, method="surface").w[: len(FLOOR)]
    whole = ao.bake(replace(mesh, opacity=None), ao.Binary(), 4096, method="surface").w[: len(FLOOR)]
    assert abs(surface - expected).mean() < 0.03 < abs(whole - expected).mean()


def test_hits_at_the_origin_of_a_ray_are_left_behind():
    """Half transparent triangles that meet at an edge occlude each other half as much as opaque ones."""
    vertices, faces = [[1, 2, 3], [2, 2, 3], [1, 3, 3], [1, 2, 4]], [[0, 1, 2], [0, 2, 3]]
    opacity = Opacity(np.zeros(2, int), (AlphaSurface(0.5),))
    opaque, half = (
        ao.bake(Mesh(vertices, faces, opacity=each), ao.Binary(), method="surface").w for each in (None, opacity)
    )
    assert opaque.min() < 0.9
    assert np.abs((1 - half) - (1 - opaque) / 2).max() < 0.003


def test_a_fine_mesh_is_sought_behind_its_holes(tmp_path):
    leaf = AlphaSurface(texture=leaf_texture(tmp_path), cutoff=0.5)
    mesh = over_floor((0.05, 0.5, leaf), (0.3, 0.9, None))
    w = ao.bake(Mesh(FLOOR, FLOOR_FACES), ao.Binary(), 1024, high=mesh, cage=0.1, denoise=False).w
    expected = 1 - form_factors(0.3, 0.9) - form_factors(0.05, right=0.0)  # side by side as seen from the hole
    behind = (FLOOR[:, 0] > 0.1) & (abs(FLOOR[:, :2]) < 0.5).all(axis=1)
    assert np.allclose(w[behind], expected[behind], atol=0.02)
    assert abs(expected - 1 + form_factors(0.25, 0.9))[behind].min() > 0.03  # what w is on top of the card


def test_texels_under_a_card(tmp_path):
    mesh = over_floor((HEIGHT, 0.5, AlphaSurface(texture=leaf_texture(tmp_path), cutoff=0.5)))
    uv = np.concatenate([(FLOOR[:, :2] + 0.9) / 3.6, 0.3 * SQUARE + 0.8])
    w = ao.bake_texture(mesh, uv, 24, ao.Binary(), 1024, denoise=False).w[:11:-1, :12].T
    x = (np.arange(12) + 0.5) / 12 * 1.8 - 0.9
    square = np.column_stack([SQUARE, np.full(4, HEIGHT)])
    square[:, 0] = np.minimum(square[:, 0], 0)
    expected = [[1 - polygon_form_factor(square, (i, j, 0), UP) for j in x] for i in x]
    assert np.allclose(w, expected, atol=0.02)


def test_rays_below_a_face_that_is_not_there_count():
    """A coarse smooth ridge of alpha 0 under a card: texels see the hemispheres of their normals."""
    slope = np.radians(40)
    x, y = np.repeat([-0.5, 0, 0.5], 2), np.tile([-1.0, 1.0], 3)
    ridge = np.column_stack([x, y, -abs(x) * np.tan(slope)])
    faces = np.array([[0, 2, 3], [0, 3, 1], [2, 4, 5], [2, 5, 3]])
    card = np.column_stack([SQUARE, np.full(4, HEIGHT)])
    opacity = Opacity([0] * 4 + [-1] * 2, [AlphaSurface(0.0)])
    tilts = np.sign(x) * slope
    normals = np.concatenate([np.column_stack([np.sin(tilts), 0 * x, np.cos(tilts)]), np.tile(UP, (4, 1))])
    mesh = Mesh(np.concatenate([ridge, card]), np.concatenate([faces, HALVES + 6]), normals, opacity=opacity)
    uv = np.concatenate([np.column_stack([x + 0.5, y / 4 + 0.5]), np.full((4, 2), [0.9, 0.02])])
    w = ao.bake_texture(mesh, uv, 16, ao.Binary(), 1024, denoise=False).w[7:9].mean(axis=0)
    for column in (5, 6, 7, 8, 9, 10):
        x = (column + 0.5) / 16 - 0.5
        side = np.array([np.sign(x) * np.sin(slope), 0, np.cos(slope)])
        normal = 2 * abs(x) * side + (1 - 2 * abs(x)) * UP
        point = np.array([x, 0.125, -abs(x) * np.tan(slope)])
        assert abs(w[column] - 1 + polygon_form_factor(card, point, normal / np.linalg.norm(normal))) < 0.015


def _card(leaf):
    vertices = np.column_stack([SQUARE, np.full(4, HEIGHT)])
    return Shape(Mesh(vertices, HALVES, opacity=Opacity([0, 0], [leaf], (SQUARE + 0.5)[HALVES])), Lambert(albedo=0.5))


def test_a_solid_with_a_hole_hides_nothing():
    box = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    walls = np.array([[q[0], q[i], q[i + 1]] for q in quads for i in (1, 2)])
    small = 0.2 * box + 0.05
    mesh = Mesh(np.concatenate([box, small]), np.concatenate([walls, walls + 8]))
    for interior in ("auto", "mark"):
        assert ao.bake(mesh, samples=16, interior=interior).flags[8:].all()
        opacity = Opacity([0] * 12 + [-1] * 12, [AlphaSurface(0.1)])
        assert not ao.bake(replace(mesh, opacity=opacity), samples=16, interior=interior).flags.any()


def test_rows_of_another_alpha_are_not_continued(tmp_path):
    leaf, output = AlphaSurface(texture=leaf_texture(tmp_path), cutoff=0.5), tmp_path / "w.npy"
    mesh, other = over_floor((HEIGHT, 0.5, leaf)), over_floor((HEIGHT, 0.5, replace(leaf, cutoff=0.4)))
    for continued in (mesh, other):
        interrupted(output, mesh=mesh)
        assert bits(bake(output, mesh=continued)) == bits(ao.bake(continued, **OPTIONS))


def test_other_processes_get_the_alpha(tmp_path):
    mesh = over_floor((HEIGHT, 0.5, AlphaSurface(texture=leaf_texture(tmp_path), cutoff=0.5)))
    scene = pickle.loads(pickle.dumps(Prepared.of(mesh, Options(falloff=ao.Binary()), None, None).scene))
    assert np.array_equal(scene.opacity.of, [-1] * len(FLOOR_FACES) + [0, 0])
    assert scene.opacity.texels.shape == (64 * 64, 1)
