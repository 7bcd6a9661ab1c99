"""One combination, drawn by a number: its scene, its files, its command, and w at some of what it bakes."""

import re
from dataclasses import dataclass

import numpy as np
import OpenImageIO as oiio
from command import obscurance
from reference import falloff

from . import caster, files
from .patches import FAMILIES, Patch, posed

VALUES, RAYS = 48, 2048  # compared, and rays of each
_MARGIN = 1.5  # texels between charts, at least


@dataclass(eq=False)
class Combination:
    """Attributes: line: the command's arguments. reported, w: its error and values (k,). truth, error: theirs (k,)."""

    line: list
    reported: float
    w: np.ndarray
    truth: np.ndarray
    error: np.ndarray


def drawn(number, folder):
    """Draw a combination, write its files into a folder, and run it."""
    return _Draw(np.random.default_rng([0xC0B1, number]), folder).run()


class _Draw:
    def __init__(self, rng, folder):
        self.rng, self.folder = rng, folder
        family = FAMILIES[rng.integers(len(FAMILIES))]
        self.patches = posed(family(rng), rng)
        corners = np.concatenate([p.at(np.array([0, 1, 1, 0.0]), np.array([0, 0, 1, 1.0])) for p in self.patches])
        self.size = float(np.linalg.norm(np.ptp(corners, axis=0)))
        self.centre = (corners.min(axis=0) + corners.max(axis=0)) / 2
        self.kind = str(rng.choice(["vertices", "faces", "texels", "points"], p=[0.4, 0.2, 0.3, 0.1]))
        self.line = []

    def chance(self, share):
        return self.rng.random() < share

    def run(self):
        named = self._write_mesh()
        medium = self._options(named)
        line = ["bake", *self.inputs, "-o", self.output, *self.line, "--threads", 1]
        done = obscurance(*line)
        self.line = line
        assert done.returncode == 0, self._failure(done.stderr)
        w, chosen, places, normals = getattr(self, f"_{self.kind}")()
        seen = ~caster.enclosed(self.occluding, places.reshape(-1, 3)).reshape(places.shape[:2]).any(axis=1)
        chosen, places, normals = chosen[seen], places[seen], normals[seen]  # others are filled
        axes = np.broadcast_to(self.up, normals.shape) if self.by_up else normals
        truth, error = caster.values(medium, places, normals, axes, self.rng, RAYS)
        return Combination(line, _reported(done.stdout), w[chosen], truth, error)

    def _failure(self, text):
        return f"obscurance {' '.join(map(str, self.line))}\n{text}"

    def _write_mesh(self):
        """Write the input; returns whether its objects have names."""
        rng, kind = self.rng, self.kind
        forms = {"texels": ["obj", "ply", "glb"], "points": ["ply"]}.get(kind, ["obj", "ply", "off", "glb", "stl"])
        if not self._near():  # a .glb and an .stl have float32
            forms = [form for form in forms if form not in ("glb", "stl")]
        self.form = form = str(rng.choice(forms))
        side = int(rng.choice([24, 32, 48, 64]))
        self.page = side, int(rng.choice([side, 32]))
        charts = self.charts = self._charts() if kind == "texels" else None
        quads = form in ("obj", "ply", "off") and kind != "faces" and self.chance(0.3)
        shared = form in ("obj", "ply", "off") and charts is None and self.chance(0.5)
        flipped = kind != "points" and form != "glb" and self.chance(0.1)
        if flipped:
            self.line += ["--flip"]
        self.model = files.model(self.patches, rng, shared, form == "stl", quads, charts, flipped)
        self.with_normals = not shared and not flipped and form in ("obj", "glb", "ply") and self.chance(0.6)
        if form in ("obj", "ply", "off") and self.chance(0.2):  # vertices that no face has
            for _ in range(int(rng.integers(1, 4))):
                self.model.vertices.append(self.centre)
                self.model.normals.append(np.array([0, 0, 1.0]))
                self.model.patch.append(-1)
                self.model.place.append((0, 0))
                if charts is not None:
                    self.model.uv.append((0, 0))
        kinds = {"text": self.chance(0.4), "double": not self._near() or self.chance(0.5)} if form == "ply" else {}
        content = files.content(self.model, form, rng, self.with_normals, **kinds)
        mesh = self.folder / f"mesh.{form}"
        mesh.write_bytes(content)
        self.inputs = [mesh]
        if kind == "points":
            self._write_cloud(mesh)
        return form in ("obj", "glb")

    def _near(self):
        """Whether float32 holds the coordinates."""
        return np.abs(self.centre).max() < 10 * self.size

    def _charts(self):
        """A rectangle of the page for each patch."""
        across = int(np.ceil(np.sqrt(len(self.patches))))
        margin = _MARGIN / np.array(self.page) * across
        charts = []
        for number in range(len(self.patches)):
            low = self.rng.uniform(margin, 0.4)
            high = self.rng.uniform(np.maximum(low, 0.5), 1 - margin)
            cell = np.array(divmod(number, across))
            charts.append((*((cell + low) / across), *((cell + high) / across)))
        return charts

    def _write_cloud(self, mesh):
        """Points over patches, of which the mesh occludes."""
        cloud = files.Model()
        for number in self.rng.integers(len(self.patches), size=VALUES):
            part = self.patches[number]
            place = self.rng.uniform(0.05, 0.95, 2)
            cloud.vertices.append(part.at(*map(np.array, place)) + 0.01 * self.size * part.normal)
            cloud.normals.append(part.normal)
        self.cloud = cloud
        (self.folder / "cloud.ply").write_bytes(files.content(cloud, "ply", self.rng, with_normals=True))
        self.inputs = [self.folder / "cloud.ply"]
        self.line += ["--points", "--occluder", mesh]

    def _options(self, named):
        """Draw options; returns what the rays meet."""
        rng, line, patches = self.rng, self.line, list(self.patches)
        line += ["--seed", int(rng.integers(1 << 30))]
        line += ["--tolerance", 0.01] if self.chance(0.4) else ["--samples", int(rng.choice([64, 256]))]
        if "--samples" in line and self.chance(0.3):
            line += ["--no-denoise"]
        # The falloff.
        form = str(rng.choice(["exponential", "binary", "linear", "smooth"], p=[0.4, 0.3, 0.15, 0.15]))
        half, limit = self.size * rng.uniform(0.05, 0.5), np.inf
        line += ["--falloff", form]
        if form == "exponential":
            line += ["--half-distance", repr(float(half))]
        if form in ("linear", "smooth") or self.chance(0.25):
            limit = float(self.size * rng.uniform(0.1, 0.8))
            line += ["--max-distance", repr(limit)]
        mu = falloff(form, half, limit)
        # Where rays go.
        spread = float(rng.choice([180, 120, 50], p=[0.8, 0.1, 0.1]))
        if spread < 180:
            line += ["--spread", spread]
        fronts = self.chance(0.15)
        if fronts:
            line += ["--back-faces", "ignore"]
        self.by_up = self.kind in ("vertices", "texels") and self.chance(0.15)
        self.up = np.array([0, 0, 1.0]) if self.form == "stl" else np.array([0, 1.0, 0])
        if self.by_up:
            line += ["--normals", "up"]
        elif self.kind != "points" and self.chance(0.3):
            line += ["--normals", str(rng.choice(["angle", "area", "equal"]))]
        # What occludes.
        self.receives = np.ones(len(patches), bool)
        names = sorted({part.name for part in patches})
        if named and len(names) > 1 and self.kind != "points" and self.chance(0.3):
            name = str(rng.choice(names))
            of_name = np.array([part.name == name for part in self.patches])
            option = str(
                rng.choice(["--exclude", "--receive", "--cast"][: 3 - self.by_up])
            )  # a face closes if it casts
            line += [option, name]
            if option == "--cast":
                patches = [part for part in self.patches if part.name == name]
            else:
                self.receives = of_name if option == "--receive" else ~of_name
                patches = patches if option == "--receive" else [part for part in self.patches if part.name != name]
        if self.chance(0.15):
            patches.append(self._write_occluder())
        ground = None
        if self.chance(0.15):
            height = float(self.centre @ self.up - self.size * rng.uniform(0.6, 0.9))
            line += ["--ground", repr(height)]
            ground = height * self.up, self.up
        if self.kind == "faces":
            line += ["--at", "faces"]
        if self.kind == "texels":
            line += ["--size", "{}x{}".format(*self.page)]
        self.occluding = patches
        self.output = self.folder / str(
            rng.choice(
                {"texels": ["w.exr", "w.png", "w.tif"], "faces": ["w.npy", "w.npz"]}.get(self.kind, self._endings())
            )
        )
        cone = np.sin(np.radians(spread / 2)) ** 2
        return caster.Medium(patches, fronts, ground, mu, cone, self.size)

    def _endings(self):
        return ["w.npy", "w.npz", "w.ply", *(["w.glb"] if self.kind == "vertices" and self.form == "glb" else [])]

    def _write_occluder(self):
        """A sheet in a file of its own, that gets no w."""
        corner = self.centre + self.size * np.array([-0.3, 0.6, -0.2])
        sheet = Patch(corner, np.array([0, 0, 0.6]) * self.size, np.array([0.5, 0.05, 0]) * self.size, (1, 1), "other")
        (self.folder / "other.obj").write_bytes(files.content(files.model([sheet], self.rng), "obj", self.rng))
        self.line += ["--occluder", self.folder / "other.obj"]
        return sheet

    def _eligible(self, patch, places):
        """Which of places (k, 3), on patches (k,), have a w that nothing else touches."""
        fits = np.zeros(len(patch), bool)
        for number in np.unique(patch[patch >= 0]):
            part, here = self.patches[number], patch == number
            alike = [np.cross(other.u, other.v) @ self.up for other in self.patches if other.name == part.name]
            turned = part.normal @ self.up < 0.02 or sum(alike) < 0  # what looks down as a whole is wound wrongly
            if not self.receives[number] or (self.by_up and turned):
                continue
            fits[here] = ~caster.touches(
                self.occluding, part, places[here], self.size, self.by_up and self.kind == "vertices"
            )
        return fits

    def _choose(self, patch, places):
        rows = np.flatnonzero(self._eligible(patch, places))
        return np.sort(self.rng.permutation(rows)[:VALUES])

    def _read(self):
        """w of the output's rows."""
        if self.output.suffix == ".npz":
            return np.load(self.output)["w"].astype(float)
        if self.output.suffix == ".npy":
            return np.load(self.output).astype(float)
        return files.read_ply(self.output)

    def _vertices(self):
        patch, place = np.array(self.model.patch), np.array(self.model.place, float)
        places = np.array(self.model.vertices)
        if self.form == "glb":  # object after object
            order = [
                index
                for name in dict.fromkeys(self.model.names)
                for index in range(len(places))
                if self.patches[patch[index]].name == name
            ]
            patch, place, places = patch[order], place[order], places[order]
        if self.output.suffix == ".glb":
            at, w = files.read_glb(self.output.read_bytes())
            assert np.allclose(at, places, atol=1e-5 * (self.size + np.abs(places).max())), self._failure(
                "other places"
            )
        else:
            w = self._read()
        assert len(w) == len(places), self._failure("another number of vertices")
        chosen = self._choose(patch, places)
        normals = np.array([self.patches[number].normal for number in patch[chosen]]).reshape(-1, 3)
        return w, chosen, places[chosen][:, None], normals

    def _faces(self):
        patch, corners = np.array(self.model.face_patch), np.array(self.model.face_places, float)
        if self.form == "glb":
            order = np.argsort(
                [list(dict.fromkeys(self.model.names)).index(self.patches[p].name) for p in patch], kind="stable"
            )
            patch, corners = patch[order], corners[order]
        w = self._read()
        assert len(w) == len(patch), self._failure("another number of faces")
        centres = [self.patches[p].at(*c.mean(axis=0)) for p, c in zip(patch, corners, strict=True)]
        chosen = self._choose(patch, np.array(centres))
        u, v = np.moveaxis(caster.strata(self.rng, len(chosen)), -1, 0)
        weights = np.stack([1 - np.sqrt(u), np.sqrt(u) * (1 - v), np.sqrt(u) * v], axis=-1)
        st = np.einsum("kpc,kcd->kpd", weights, corners[chosen])
        return w, chosen, *self._on_patches(patch[chosen], st)

    def _on_patches(self, patch, st):
        """Places (k, p, 3) at coordinates (k, p, 2) of patches (k,), and the patches' normals."""
        places = np.array([self.patches[p].at(s[:, 0], s[:, 1]) for p, s in zip(patch, st, strict=True)]).reshape(
            *st.shape[:2], 3
        )
        normals = np.array([self.patches[p].normal for p in patch])
        return places, normals.reshape(-1, 3)

    def _texels(self):
        width, height = self.page
        image = oiio.ImageInput.open(str(self.output))
        pixels = image.read_image(0, 0, 0, image.spec().nchannels, "float")
        image.close()
        assert pixels.shape[:2] == (height, width), self._failure("another size")
        w = pixels[..., 0].astype(float).ravel()
        low = np.stack(np.meshgrid(np.arange(width), np.arange(height)[::-1]), -1).reshape(-1, 2) / (width, height)
        high = low + 1 / np.array([width, height])
        patch = np.full(len(w), -1)
        rectangles = np.zeros((len(w), 4))
        for number, chart in enumerate(self.charts):
            inside = np.concatenate([np.maximum(low, chart[:2]), np.minimum(high, chart[2:])], axis=1)
            covered = np.prod(np.maximum(inside[:, 2:] - inside[:, :2], 0), axis=1) * width * height > 0.05
            patch[covered] = number
            extent = np.array([chart[2] - chart[0], chart[3] - chart[1]])
            rectangles[covered] = ((inside - np.tile(chart[:2], 2)) / np.tile(extent, 2))[covered]
        middle = (rectangles[:, :2] + rectangles[:, 2:]) / 2
        at = np.array([self.patches[max(p, 0)].at(*m) for p, m in zip(patch, middle, strict=True)])
        chosen = self._choose(patch, at)
        share = caster.strata(self.rng, len(chosen))
        st = rectangles[chosen, None, :2] + share * (rectangles[chosen, None, 2:] - rectangles[chosen, None, :2])
        return w, chosen, *self._on_patches(patch[chosen], st)

    def _points(self):
        w = self._read()
        places, normals = np.array(self.cloud.vertices), np.array(self.cloud.normals)
        assert len(w) == len(places), self._failure("another number of points")
        return w, np.arange(len(places)), places[:, None], normals


def _reported(summary):
    """The error that the command's summary has."""
    return float(re.search(r"RMSE[^\d.]*([\d.e-]+)", summary)[1])
