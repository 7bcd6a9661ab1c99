"""Axes of one's own, also in faces, near to them or below: what a face has below is closed, wherever the axis points.

The reference traces rays of its own, in double precision, from just in front of the faces that hold a place.
"""

import numpy as np
import pytest
from meshes import crumpled, grid
from scipy.spatial.transform import Rotation

from obscurance import ao
from obscurance.ao.points.receivers import find_receivers
from obscurance.raytrace import Mesh
from obscurance.raytrace.mesh.placement import Placement
from obscurance.scenes.geometry.polyhedra import icosphere

CELLS = 4
PIXELS = 10  # texels along a patch
MODES = {"plain": {}, "ignore": {"back_faces": "ignore"}, "cone": {"spread": 100.0}}
SAMPLES, RAYS = 512, 1 << 9  # of the reference


def patch(corner, u, v):
    """A parallelogram as a grid of vertices."""
    return corner + (grid(CELLS)[0][:, :2] + 0.5) @ [u, v]


def sheet(random, low, high):
    """A sheet whose front leans by between `low` and `high` degrees from up."""
    turn = Rotation.from_euler("zx", [random.uniform(0, 360), random.uniform(low, high)], degrees=True)
    return [turn.apply(patch((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0)))]


def box(random):
    """A box that stands, turned about the vertical."""
    sides = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            side = patch((-0.5 * sign, -0.5, 0.5 * sign), (sign, 0, 0), (0, 1, 0))
            sides.append(np.roll(side, axis + 1, axis=1))
    turn = Rotation.from_euler("z", random.uniform(0, 360), degrees=True)
    return [turn.apply(side * [1.0, 1.7, 0.6]) for side in sides]


def cards(random):
    """Blades of grass, whose fronts look any way about the horizontal."""
    blades = []
    for _ in range(9):
        turn = Rotation.from_euler("zx", [random.uniform(0, 360), random.uniform(75, 105)], degrees=True)
        blades.append(turn.apply(patch((-0.5, -0.5, 0), (1, 0, 0), (0, 1, 0))) + random.uniform(-1, 1, 3) * [1, 1, 0])
    return blades


SHAPES = {
    "sheet": lambda random: sheet(random, 80, 100),
    "slope": lambda random: sheet(random, 10, 60),
    "overhang": lambda random: sheet(random, 100, 130),
    "box": box,
    "cards": cards,
}


class Scene:
    """Patches of a shape, placed anywhere, with `up` as the axis of all, or the file's axes, turned along."""

    def __init__(self, shape, seed, normals):
        random = np.random.default_rng(seed)
        self.shape = shape
        patches = np.array(SHAPES[shape](random))
        self.axis = np.array([0.0, 0.0, 1.0])
        if normals == "file":
            turn = Rotation.random(random_state=seed)
            patches = turn.apply(patches.reshape(-1, 3)).reshape(patches.shape)
            self.axis = turn.apply(self.axis)
        size = 10 ** random.uniform(-3, 3)
        vertices = size * (patches.reshape(-1, 3) + 3 * random.normal(size=3))
        _, faces = grid(CELLS)
        self.per_patch = len(faces)
        starts = (CELLS + 1) ** 2 * np.arange(len(patches))[:, None, None]
        faces = (faces + starts).reshape(-1, 3)
        self.normals = normals
        given = np.tile(self.axis, (len(vertices), 1)) if normals == "file" else None
        self.mesh = Mesh(vertices, faces, given, up="z")
        self.size = size
        self.corners = vertices[faces]
        across = np.cross(self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0])
        self.face_normals = across / np.linalg.norm(across, axis=1, keepdims=True)

    def vertices(self, options):
        """w at vertices, of a box within their patch, and the reference's places and normals there."""
        w = ao.bake(self.mesh, "binary", samples=SAMPLES, normals=self.normals, **options).w
        of = np.zeros(len(w), np.int64)
        of[self.mesh.faces.ravel()] = np.repeat(np.arange(len(self.mesh.faces)), 3)
        i, j = np.divmod(np.arange(len(w)) % (CELLS + 1) ** 2, CELLS + 1)
        inner = (self.shape != "box") | (np.minimum(i, j) > 0) & (np.maximum(i, j) < CELLS)
        return w[inner], self.mesh.vertices[inner], self.face_normals[of[inner]]

    def faces(self, options):
        """w of faces, and centres."""
        w = ao.bake(self.mesh, "binary", samples=SAMPLES, normals=self.normals, at="faces", **options).w
        return w, self.corners.mean(axis=1), self.face_normals

    def points(self, options):
        """w at points on faces."""
        weights = np.random.default_rng(4).dirichlet([1, 1, 1], len(self.corners))
        places = np.einsum("fc,fci->fi", weights, self.corners)
        axes = np.tile(self.axis, (len(places), 1))
        w = ao.bake_points(self.mesh, places, axes, falloff="binary", samples=SAMPLES, **options).w
        return w, places, self.face_normals

    def texels(self, options):
        """w of the texels of a page with a chart for each patch."""
        count = len(self.corners) // self.per_patch
        side = int(np.ceil(np.sqrt(count)))
        number = np.arange(len(self.mesh.vertices))
        i, j = np.divmod(number % (CELLS + 1) ** 2, CELLS + 1)
        row, column = np.divmod(number // (CELLS + 1) ** 2, side)
        cell = PIXELS + 2
        uv = np.stack([column * cell + 1 + i / CELLS * PIXELS, row * cell + 1 + j / CELLS * PIXELS], -1) / (side * cell)
        texture = ao.bake_texture(
            self.mesh, uv[self.mesh.faces], side * cell, "binary", samples=SAMPLES, normals=self.normals, **options
        )
        w, places, normals = [], [], []
        for k in range(count):
            origin = self.mesh.vertices[(CELLS + 1) ** 2 * k]
            u = self.mesh.vertices[(CELLS + 1) ** 2 * k + CELLS * (CELLS + 1)] - origin
            v = self.mesh.vertices[(CELLS + 1) ** 2 * k + CELLS] - origin
            for x, y in ((1, 2), (5, 5), (8, 3), (4, 7)):
                row, column = k // side * cell + 1 + y, k % side * cell + 1 + x
                w.append(texture.w[::-1][row, column])
                places.append(origin + (x + 0.5) / PIXELS * u + (y + 0.5) / PIXELS * v)
                normals.append(self.face_normals[self.per_patch * k])
        return np.array(w), np.array(places), np.array(normals)


def directions(axis, count, spread=180.0):
    """Cosine-weighted directions about an axis, within a cone: a golden lattice."""
    number = np.arange(count)
    radius = np.sqrt((number + 0.5) / count) * np.sin(np.radians(spread / 2))
    turn = 2 * np.pi * (number * 0.6180339887498949 % 1)
    u = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    u /= np.linalg.norm(u)
    local = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.sqrt(1 - radius**2)], -1)
    return local @ np.stack([u, np.cross(axis, u), axis])


def reference(corners, origin, rays, one_sided=False, normal=(0, 0, 0)):
    """The share of rays from an origin, and above its face, that meet none of the triangles (m, 3, 3)."""
    a = corners - origin
    across = np.cross(a[:, 1] - a[:, 0], a[:, 2] - a[:, 0])
    facing = rays @ across.T
    sides = [rays @ np.cross(a[:, k], a[:, (k + 1) % 3]).T for k in range(3)]
    volume = np.einsum("ij,ij->i", a[:, 0], across)
    inside = (np.min(sides, axis=0) >= 0) | (np.max(sides, axis=0) <= 0)
    met = inside & (volume * facing > 0) & ((facing < 0) | (not one_sided))
    return 1 - (met.any(axis=1) | (rays @ np.asarray(normal) < 0)).mean()


def expected(scene, places, normals, options, of_file=False):
    """w at places on faces of these normals. Args: of_file: whether axes behind their face are none, and the face's is
    taken."""
    rays = directions(scene.axis, RAYS, options.get("spread", 180.0))
    lifted = places + 1e-7 * scene.size * normals
    w = []
    for origin, normal in zip(lifted, normals, strict=True):
        held = np.zeros(3) if scene.shape == "box" else normal  # whose edges lie on several faces
        if of_file and normal @ scene.axis < -0.01:
            rays_there = directions(normal, RAYS, options.get("spread", 180.0))
        else:
            rays_there = rays
        w.append(reference(scene.corners, origin, rays_there, "back_faces" in options, held))
    return w


@pytest.mark.parametrize(
    ("shape", "mode"),
    [(shape, mode) for shape in SHAPES for mode in MODES if mode == "plain" or shape in ("box", "cards")],
)
@pytest.mark.parametrize("kind", ["vertices", "faces", "texels", "points"])
def test_what_a_face_has_below_is_closed(kind, shape, mode):
    for seed, normals in ((1, "up"), (2, "file")):
        if (kind, normals) == ("faces", "file"):  # faces have hemispheres about their own normals
            continue
        scene = Scene(shape, seed, normals)
        w, places, face_normals = getattr(scene, kind)(MODES[mode])
        if kind == "points":  # whose axes choose the back of a face that they are far behind
            seen = face_normals @ scene.axis > -0.7
            w, places, face_normals = w[seen], places[seen], face_normals[seen]
        some = np.random.default_rng(seed).permutation(len(w))[:12]
        of_file = normals == "file" and kind != "points"
        truth = np.array(expected(scene, places[some], face_normals[some], MODES[mode], of_file))
        error = np.sort(w[some] - truth)
        if shape == "cards":  # w is a mean over a face or a texel, and blades meet
            error = error[2:-2]
        assert abs(error.mean()) < 0.012, (seed, error.mean())
        assert np.abs(error).max() < (0.05 if shape == "cards" else 0.03)


@pytest.mark.parametrize("seed", range(2))
def test_each_side_of_an_edge_of_a_box_sees_what_it_does_not_have_below(seed):
    scene = Scene("box", seed, "up")
    w = ao.bake(scene.mesh, "binary", samples=SAMPLES, normals="up").w
    normals = scene.face_normals[:: scene.per_patch].repeat((CELLS + 1) ** 2, axis=0)
    exact = (1 + np.maximum(normals @ scene.axis, -1)) / 2
    assert w == pytest.approx(exact, abs=0.02)


def test_balls_are_open_by_how_much_they_lean():
    """Whatever the axis, a ball never sees its inside: (1 + cos θ)/2 also below the equator."""
    vertices, faces = icosphere(4)
    mesh = Mesh(vertices, faces, up="z")
    exact = (1 + vertices[:, 2] / np.linalg.norm(vertices, axis=1)) / 2
    assert np.abs(ao.bake(mesh, "binary", samples=SAMPLES, normals="up").w - exact).max() < 0.04  # facets lean by .04
    centres = vertices[faces].mean(axis=1)
    exact = (1 + centres[:, 2] / np.linalg.norm(centres, axis=1)) / 2
    assert np.abs(ao.bake(mesh, "binary", samples=SAMPLES, normals="up", at="faces").w - exact).max() < 0.01


@pytest.mark.parametrize("method", ["vertex", "surface"])
def test_a_tilted_normal_of_the_file_is_an_axis_by_either_method(method):
    scene = Scene("slope", 5, "file")
    exact = (1 + scene.face_normals[0] @ scene.axis) / 2
    baked = ao.bake(scene.mesh, "binary", samples=SAMPLES, normals="file", method=method)
    i, j = np.divmod(np.arange(len(baked.w)), CELLS + 1)
    inner = (np.minimum(i, j) > 0) & (np.maximum(i, j) < CELLS)
    assert np.abs(baked.w - exact)[inner].max() < 0.01
    assert baked.interpolation.rmse < 0.3  # of which borders have some


@pytest.mark.parametrize("coarse", [0, 1, 2])
def test_smooth_normals_of_the_file_leave_convex_textures_open(coarse):
    """As computed ones do: there the face stands for a surface that has nothing below the axis' plane."""
    vertices, faces = icosphere(coarse)
    normals = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    side = int(np.ceil(np.sqrt(len(faces))))
    row, column = np.divmod(np.arange(len(faces)), side)
    chart = np.array([[0.1, 0.1], [0.9, 0.1], [0.1, 0.9]])
    uv = (np.stack([column, row], -1)[:, None] + chart) / side
    texture = ao.bake_texture(Mesh(vertices, faces, normals), uv, 8 * side, "binary", samples=64, normals="file")
    assert texture.w[texture.covered].min() > 0.99


def test_wound_the_wrong_way_round_a_surface_has_its_front_where_axes_are():
    scene = Scene("slope", 6, "up")
    again = Mesh(scene.mesh.vertices, scene.mesh.faces[:, ::-1], up="z")
    for at in ("vertices", "faces"):
        w, flipped = (ao.bake(m, "binary", samples=SAMPLES, normals="up", at=at).w for m in (scene.mesh, again))
        assert np.abs(w - flipped).max() < 0.02


def test_folded_vertices_have_the_axis_at_each_of_their_corners():
    vertices, faces = crumpled(icosphere(2), 0.5, 3)
    mesh = Mesh(vertices, faces, up="z")
    placement = Placement.of(mesh)
    receivers = find_receivers(mesh, placement, "up")
    corners = receivers.corners
    assert len(corners) > 20
    baked = ao.bake(mesh, "binary", samples=1 << 12, normals="up", denoise=False)
    assert baked.flagged["folded"] == 0
    triangles = placement.vertices[mesh.faces].astype(np.float64)
    rays = directions(np.array([0.0, 0.0, 1.0]), 1 << 10)
    for row in range(0, len(corners), 5):
        samples = slice(corners.starts[row], corners.starts[row + 1])
        origins, weights = corners.points.origins[samples].astype(np.float64), corners.weights[samples]
        truth = weights @ [reference(triangles, origin, rays) for origin in origins]
        of = np.flatnonzero(receivers.of_vertex == corners.point_rows[row])
        assert baked.w[of] == pytest.approx(truth, abs=0.03)
