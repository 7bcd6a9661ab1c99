"""The options of bakes, each declared here, once: its type, bounds, default, meaning, and how the command has it.

Checks, what decides kept rows, and options of the command follow from a declaration (`ao/declared.py`); `ao.bake`
and `ao.bake_texture` have them as parameters. Those whose values are meshes are in `ao/prepared.py`.
"""

import math
from dataclasses import KW_ONLY
from typing import TYPE_CHECKING, Annotated, Any, Literal

from .declared import EVERY_BAKE, IMAGE, Option, check_values, options_of, options_record

if TYPE_CHECKING:  # the help of the command imports nothing heavy
    from obscurance.raytrace.mesh.mesh import Mesh
    from obscurance.raytrace.types import Bools

    from .falloff import Falloff, Falloffs, Length
    from .mu import Mu

MAX_SAMPLES = 1 << 20
DEFAULT_TOLERANCE = 0.005
DEFAULT_SAMPLES = 256  # where no tolerance can be met: in parts, and without denoising
_MOST_FOR_TOLERANCE = 1 << 14
_FITTED = 1 << 26  # rays of the surface method in all, at most: a coarse mesh needs more a vertex than a dense one
FITS_INPUT = "which fits over the input's own faces"
OCTAVES = tuple(0.005 * 2**octave for octave in range(10))  # half-distances of profiles, of the radius

Method = Literal["vertex", "surface"]
Weighting = Literal["angle", "area", "equal"]
Normals = Literal["angle", "area", "equal", "file", "up"]
Interior = Literal["auto", "ignore", "mark", "fill"]
Weight = Literal["cosine", "uniform"]
BackFaces = Literal["occlude", "ignore"]
At = Literal["vertices", "faces"]
_NOT_AT_FACES = "high", "colors", "debug_image"
Overlap = Literal["mean", "first", "refuse"]
BentSpace = Literal["world", "tangent", "tangent-directx"]


# fmt: off
@options_record
class Options:
    """Options of every bake.

    Raises:
        OptionError: one is out of range, or does not go with another.
    """

    falloff: Annotated["Falloffs", Option(bake_kinds="", role="input")] = None
    samples: Annotated[int | None, Option(bounds=(1, MAX_SAMPLES), help=
        "Rays per vertex or texel, in place of a tolerance; with --tolerance the most, by default 16384.")] = None
    seed: Annotated[int, Option(bounds=(0, 2**64 - 1), help="Random seed.")] = 0
    threads: Annotated[int | None, Option(bounds=(1, 4096), role="run", bake_kinds=EVERY_BAKE, help=
        "Number of threads, by default all cores; results are the same.")] = None
    normals: Annotated[Normals, Option(help=
        "Normals: the file's own at corners, and where it has none of use, as with angle; those of faces around, "
        "weighted by angle, by area or equally, smooth across edges of up to 30 degrees; or up.")] = "file"
    _: KW_ONLY
    tolerance: Annotated[float | None, Option(bounds=(1e-5, 1), bake_kinds=EVERY_BAKE, help=
        "Target RMS error of w, 0.005 by default; ray counts are chosen to meet it.")] = None
    denoise: Annotated[bool, Option(help=
        "Shrink estimates towards those of neighbours.")] = True
    interior: Annotated[Interior, Option(help=
        "Vertices inside closed solids: ignore, flag (mark), or fill from visible neighbours; auto fills those inside "
        "parts of the mesh that are closed.")] = "auto"
    thickness: Annotated[bool, Option(help=
        "How thick the solid is below each point instead: the same rays inwards, 0 thin, 1 thick.")] = False
    spread: Annotated[float, Option(bounds=(1, 180), help=
        "Full angle in degrees of the cone of rays about the normal, in which 180, the hemisphere, is all.")] = 180.0
    weight: Annotated[Weight, Option(help=
        "Of directions: like their cosine to the normal, or uniform, so that w is a share of the solid angle.")
        ] = "cosine"
    back_faces: Annotated[BackFaces, Option(help=
        "ignore: rays pass through faces that they meet from behind, as through single-sided walls.")] = "occlude"
    profile: Annotated[bool, Option(kind=bool | None, default=None, help=
        "Also store w at half-distances an octave apart, from .5% to 256% of the radius, so that the half-distance can "
        "be chosen later: .npz .ply .glb .html, textures .exr; by default in .html, if that costs little.")
        ] = False
    cage: Annotated["Length | Mesh | Any", Option(kind=str | None, default=None, needs={"high": ...}, help=
        'With --high: how far it may be from the input, mesh units or "2%" of the radius (the default); or a mesh '
        "file, the input with its vertices moved outwards.", metavar="LENGTH|MESH")] = "2%"

    def __post_init__(self) -> None:
        from obscurance.raytrace.errors import ConflictError

        from .falloff import falloffs_of, is_length, resolve_length

        object.__setattr__(self, "falloff", falloffs_of(self.falloff))
        check_values(self)
        if self.samples is None and self.tolerance is None and self.denoise:
            object.__setattr__(self, "tolerance", DEFAULT_TOLERANCE)
        if is_length(self.cage):
            resolve_length("cage", self.cage, 1.0)
        if self.thickness and self.interior in ("mark", "fill"):
            interior = "interior", self.interior
            raise ConflictError("thickness", "does not go with", interior, why="as rays start inside")

    @property
    def method(self) -> Method:
        """How w of vertices is estimated."""
        return "vertex"

    @property
    def only(self) -> "Bools | None":
        """The vertices whose w is wanted; None: all."""
        return None

    @property
    def falloffs(self) -> "tuple[Falloff, ...]":
        """The falloffs that were given."""
        return self.falloff if isinstance(self.falloff, tuple) else (self.falloff,)

    @property
    def cone(self) -> float:
        """sin² of half the spread."""
        return math.sin(math.radians(self.spread / 2)) ** 2

    @property
    def columns(self) -> int:
        """How many estimates there are of each w."""
        return len(self.falloffs) + len(OCTAVES) * self.profile

    def mus(self, radius: float) -> "tuple[Mu, ...]":
        """`every_falloff` for a mesh of bounding-sphere radius `radius`."""
        return tuple(falloff.resolve(radius) for falloff in self.every_falloff)

    @property
    def every_falloff(self) -> "tuple[Falloff, ...]":
        """The falloffs, then those of the profile, which end where the first does, unless it is a table."""
        from .falloff import Exponential, Tabulated

        if not self.profile:
            return self.falloffs
        main = self.falloffs[0]
        limit = math.inf if isinstance(main, Tabulated) else main.max_distance
        octaves = [Exponential(half_distance=f"{100 * share:g}%", max_distance=limit) for share in OCTAVES]
        return (*self.falloffs, *octaves)

    @property
    def identity(self) -> tuple[object, ...]:
        """Every option that can change a ray; μ with lengths in mesh units stands for the falloff. Inputs are left
        out."""
        import numpy as np

        from .falloff import is_length

        values = {name: getattr(self, name) for name, row in options_of(self).items() if row.role == "result"}
        only = None if self.only is None else np.packbits(self.only).tobytes()
        cage = self.cage if is_length(self.cage) else None  # what is traced from is hashed
        return tuple((values | {"samples": self.rays, "only": only, "cage": cage}).items())

    @property
    def rays(self) -> int:
        """Rays of a vertex; to a tolerance the most that it may get."""
        if self.samples is not None:
            return self.samples
        return DEFAULT_SAMPLES if self.tolerance is None else _MOST_FOR_TOLERANCE

    def rays_in_all(self, vertices: int) -> int:
        """Rays of so many vertices; to a tolerance the most that they may get."""
        rays = self.rays * vertices
        if self.method == "vertex" or self.samples is not None:
            return rays
        return max(rays, _FITTED)


@options_record
class VertexOptions(Options):
    """Options of a bake to vertices.

    Raises:
        OptionError: as `Options`, or one is of the other method.
    """

    _: KW_ONLY
    only: Annotated["Bools | None", Option(bake_kinds="")] = None
    method: Annotated[Method, Option(bake_kinds="vertices batch", help=
        "Sample at the vertices, or all over the faces with a least-squares fit.")] = "vertex"
    at: Annotated[At, Option(bake_kinds="vertices batch", excludes=_NOT_AT_FACES, help=
        "faces: w of each face, its mean over the face, into .npy, .npz or .ply.")] = "vertices"
    both_sides: Annotated[bool, Option(bake_kinds="vertices batch", excludes=_NOT_AT_FACES, help=
        "Also w of the backs of faces.")] = False

    def __post_init__(self) -> None:
        import numpy as np

        from obscurance.raytrace.errors import ConflictError

        super().__post_init__()
        if self.only is not None:
            object.__setattr__(self, "only", np.asarray(self.only))
        if self.method == "vertex":
            return
        if self.at == "faces":
            raise ConflictError(("at", "faces"), "does not go with", ("method", "surface"), why="which fits vertices")


@options_record
class TextureOptions(Options):
    """Options of a bake to a texture."""

    _: KW_ONLY
    overlap: Annotated[Overlap, Option(kind=Overlap | None, default=None, bake_kinds=IMAGE, help=
        "Texture: where faces overlap, w is their mean (the default within a material), the first's, or an error.")
        ] = "mean"
    wrap: Annotated[bool, Option(bake_kinds="")] = True
    close_seams: Annotated[bool, Option(bake_kinds="", role="output")] = True
    bent_space: Annotated[BentSpace, Option(kind=BentSpace | None, default=None, bake_kinds="texture",
        role="output", needs={"bent_normals": ...}, is_setting=False, help=
        "Of bent normals: the mesh's own (the default), or tangent: +Y, or with -directx -Y.")] = "world"

    def __post_init__(self) -> None:
        from obscurance.raytrace.errors import ConflictError

        super().__post_init__()
        if self.interior == "mark":
            raise ConflictError(("interior", "mark"), "does not go with", "a texture", why="whose texels have no flags")
# fmt: on
