"""The pages of a bake: one for all faces, or one each for materials, objects and UDIM tiles; and remarks on them.

Materials with layouts of their own lie over one another in texture coordinates, where one page would show their mean.
In a .glb they become pages of their own, in images by placeholders in the output's name. Within a material, faces that
overlap are taken to be meant so, as mirrored halves are; so are objects whose common material has an image, and
instances of one mesh unless each is to have its own page.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from obscurance import ao
from obscurance.ao.texture.coverage import reaches_into_page, shared_texels
from obscurance.ao.texture.uv_layout import UVLayout, have_area, on_page
from obscurance.raytrace.errors import MeshError, OptionError, first_names
from obscurance.raytrace.sampling import hash32_array
from obscurance.raytrace.system.checks import check_outputs
from obscurance.raytrace.types import Bools, Float64s

from ..asset.asset import Asset, Run
from ..formats.images import MATERIAL, OBJECT, UDIM, tile_number, udim_tiles
from ..safe_paths import file_words
from ..show.progress import progress
from .uv import Coordinates, coordinates

if TYPE_CHECKING:
    from ..asset.objects import ObjectSelection
    from .plan import Plan

_SOME = 0.01  # of the texels of the smaller of two layouts, that may overlap
_LOOKED_AT, _SURE = 1 << 16, 4.0  # texels, before all are; and standard errors of what is found in them
_NOTED = 1e-3  # of the covered texels, that may overlap without a word
_LISTED = 3  # pieces without texture coordinates


@dataclass(frozen=True, eq=False)
class Page:
    """One page: texture coordinates (m, 3, 2), NaN of faces on others, and words for placeholders in its name."""

    uv: Float64s  # (m, 3, 2), NaN of faces that are not on it
    wraps: bool = True  # whether what lies outside of it is taken modulo 1
    name: str = ""  # of a texture set, where one file holds several
    words: dict[str, str] = field(default_factory=dict)  # for placeholders in the names of its files
    shown: Float64s | None = None  # `uv` also of instances that show what is baked for the first one; None: `uv`

    def path(self, template: Path) -> Path:
        """The name of this page's image: a template with the placeholders replaced."""
        name = template.name
        for placeholder, word in self.words.items():
            name = name.replace(placeholder, word)
        return template.with_name(name)


class Layouts:
    """The layouts of a mesh file: sets of faces, of a material or of its part in one object, which may overlap.

    Attributes: of: (m,), the layout of each face. instance: (m,), the mesh's instance that each belongs to, of those on
        the pages; 0 of new coordinates, which no two instances have in common.
    """

    def __init__(self, source: Asset, coordinates: Coordinates) -> None:
        self.of, self.instance = np.zeros((2, len(source.mesh.faces)), np.int64)
        self.all = [
            piece._replace(faces=piece.faces[mask])
            for piece in source.runs()
            for new in (coordinates.new[piece.faces],)
            for mask in (~new, new)
            if mask.any()
        ]
        self.pieces: list[Run] = []  # one of each layout
        self.images: list[Hashable] = []  # one of each layout, or a key that is the layout's own
        self.path = source.path
        keys: dict[Hashable, int] = {}
        owners: dict[Hashable, dict[Hashable, int]] = {}
        for piece in self.all:
            new = bool(coordinates.new[piece.faces].any())
            image = source.material(piece.material.key).image(coordinates.number or 0)
            shared = image is not None and not new
            key = piece.material.key, None if shared else piece.body, new
            if key not in keys:
                self.pieces.append(piece)
                self.images.append("new" if new else ("image", image) if shared else key)
            self.of[piece.faces] = keys.setdefault(key, len(keys))
            if not new and on_page(coordinates.uv[piece.faces]).any():
                same = owners.setdefault(piece.body, {})
                self.instance[piece.faces] = same.setdefault(piece.object.key, len(same))

    def clashes(
        self, page: Page, size: tuple[int, int], threads: int | None
    ) -> Iterator[tuple[dict[tuple[int, int], int], str]]:
        """In how many texels pairs of layouts overlap on a page, and the word before these numbers.

        First come the pairs that surely do, from some texels; if they leave a doubt, all that do, from all texels.
        """
        used = np.unique(self.of[on_page(page.uv)])
        if len(used) < 2:
            return
        layout = UVLayout.of(page.uv, size, page.wraps, self.path)
        count = size[0] * size[1]
        if count > _LOOKED_AT:
            some = np.unique(hash32_array(np.arange(_LOOKED_AT)) % np.uint32(count)).astype(np.int64)
            shared, covered = shared_texels(layout, self.of, threads, some)
            off = {pair: _SURE * found**0.5 for pair, found in shared.items()}
            limit = {pair: _SOME * min(covered[list(pair)]) for pair in shared}
            above = {pair: found for pair, found in shared.items() if found - off[pair] > limit[pair]}
            yield {pair: int(float(f"{found * count / len(some):.1g}")) for pair, found in above.items()}, "about "
            others = (pair for pair in shared if pair not in above)
            if _SOME * min(covered[used]) > _SURE**2 and all(
                shared[pair] + off[pair] + _SURE**2 < limit[pair] for pair in others
            ):
                return
        shared, covered = shared_texels(layout, self.of, threads)
        yield {pair: found for pair, found in shared.items() if found > _SOME * min(covered[list(pair)])}, ""

    def sets(self, clashes: dict[tuple[int, int], int]) -> Iterator[tuple[str, Bools]]:
        """Names and faces (m,) of texture sets: layouts that share an image and do not overlap share a set."""
        pages: list[list[int]] = []
        for layout, image in enumerate(self.images):
            beside = [layouts for layouts in pages if self.images[layouts[0]] == image]
            free = (layouts for layouts in beside if not any((other, layout) in clashes for other in layouts))
            page = next(free, None)
            if page is None:
                pages.append(page := [])
            page.append(layout)
        names = file_words(self.pieces[page[0]].material.name for page in pages)
        return zip(names, (np.isin(self.of, page) for page in pages), strict=True)

    def by_instance(self, pages: Sequence[Page]) -> list[Page]:
        """The pages, but one for each instance, named by its object, where a page holds several instances of a mesh."""
        split_pages: list[Page] = []
        for page in pages:
            numbers = np.where(on_page(page.uv), self.instance, -1)
            every = np.unique(numbers[numbers >= 0])
            for number in every:
                names = [piece.object.name for piece in self.all if (numbers[piece.faces] == number).any()]
                name = f"{page.name} {names[0]}".strip() if len(every) > 1 else page.name
                split_pages.append(replace(page, uv=_masked(page.uv, numbers == number), name=name))
        if len(split_pages) == len(pages):
            return split_pages
        words = file_words(page.name for page in split_pages)
        return [replace(page, name=word, words={MATERIAL: word}) for page, word in zip(split_pages, words, strict=True)]


def pages_of(plan: Plan, source: Asset, coordinates: Coordinates) -> list[Page]:
    """The pages of a plan, each of some faces.

    Raises: OptionError: layouts would share one that overlap, and may not; or tiles that have no number.
    """
    layouts = Layouts(source, coordinates)
    pages = _pages(plan, source, layouts, coordinates)
    if plan.options.instances == "own":
        apart = layouts.by_instance(pages)
        if len(apart) > len(pages) and plan.ending != ".glb":
            raise OptionError("output", f"{OBJECT} in its name, or a .glb: instances have a texture each", plan.output)
        pages = apart
    if plan.options.instances == "first":
        of_first = [replace(page, uv=_masked(page.uv, layouts.instance == 0), shown=page.uv) for page in pages]
        pages = [page for page in of_first if on_page(page.uv).any()]
    return pages or [Page(coordinates.uv)]


def _pages(plan: Plan, source: Asset, layouts: Layouts, coordinates: Coordinates) -> list[Page]:
    """The pages by material, object and tile, before several instances of a mesh are parted."""
    mixed = plan.options.overlap is not None or coordinates.number is None  # new layouts do not overlap
    threads = plan.options.threads
    # A .glb has one page, or one for each set of layouts that do not overlap.
    if plan.ending == ".glb":
        one_page = Page(coordinates.uv, words={MATERIAL: "all"})
        pages = [one_page]
        for clashes, _ in () if mixed else layouts.clashes(one_page, coordinates.size, threads):
            sets = layouts.sets(clashes) if clashes else []
            parted = [Page(_masked(coordinates.uv, mask), name=name, words={MATERIAL: name}) for name, mask in sets]
            pages = [page for page in parted if on_page(page.uv).any()] or [one_page]
            outputs_of(plan, pages)
        return pages
    # Images: a page for each group and tile that the name tells apart.
    output = plan.output
    pages = []
    for words, mask in _groups(layouts.all, output, len(source.mesh.faces)):
        uv = _masked(coordinates.uv, mask)
        shown = uv[have_area(uv)]
        if UDIM in output.name and len(shown):
            tiles = [tile for tile in udim_tiles(shown, source.path) if reaches_into_page(shown - tile, source.path)]
            pages += [Page(uv - tile, False, words=words | {UDIM: tile_number(tile)}) for tile in tiles]
        elif on_page(uv).any():
            pages.append(Page(uv, words=words))
    for page in () if mixed else pages:
        for clashes, about in layouts.clashes(page, coordinates.size, threads):
            if clashes:
                raise _refusal(source, layouts, clashes, page.path(output), about)
    return pages


@dataclass(frozen=True, eq=False)
class Layout:
    """Where faces lie on pages, and the falloff: in mesh units where groups of objects are baked."""

    coordinates: Coordinates
    pages: list[Page]
    falloff: ao.Falloff

    @classmethod
    def of(cls, plan: Plan, source: Asset, chosen: ObjectSelection) -> Layout:
        """The layout of a plan: texture coordinates, pages and falloff.

        Raises: as `coordinates`, `pages_of`, `outputs_of`, `check_outputs`, `ObjectSelection.of_page`.
        """
        if plan.glb:
            from ..formats.gltf.vertices import check_vertices

            check_vertices(source)
        with progress(plan.options.quiet, "texture coordinates", form=plan.options.progress):
            of_faces = coordinates(plan, source, chosen)
        pages = pages_of(plan, source, of_faces)
        check_outputs(outputs_of(plan, pages), [*plan.inputs, *source.files])
        for page in pages:
            check_area(source, page)
            chosen.of_page(page.uv)
        return cls(of_faces, pages, chosen.absolute(plan.falloff))


def outputs_of(plan: Plan, pages: Sequence[Page]) -> dict[str, Path]:
    """The files to write by what the user calls them. Raises: OptionError: several pages have one name for an image."""
    outputs: dict[str, Path] = {}
    for option, path in plan.outputs.items():
        is_image = path in plan.images.values()
        if len(pages) > 1 and is_image and pages[0].path(path) == path:
            name = option.removeprefix("--").replace("-", "_")
            raise OptionError(name, f"{MATERIAL} in its name: overlapping materials have a texture each", path)
        for target in [page.path(path) for page in pages] if is_image else [path]:
            outputs[option if target == path else f"{option} {target.name}"] = target
    return outputs


def _groups(all_groups: Sequence[Run], output: Path, count: int) -> list[tuple[dict[str, str], Bools]]:
    """Groups of faces (m,) by <MATERIAL> and <OBJECT>, as far as a name has these, and the words for them."""
    columns = {MATERIAL: [piece.material for piece in all_groups], OBJECT: [piece.object for piece in all_groups]}
    words = []
    for placeholder, column in columns.items():
        if placeholder in output.name:
            different = dict.fromkeys(column)
            words_of = dict(zip(different, file_words(item.name for item in different), strict=True))
            words.append([(placeholder, words_of[item]) for item in column])
    groups: dict[tuple[tuple[str, str], ...], Bools] = {}
    for number, piece in enumerate(all_groups):
        key = tuple(column[number] for column in words)
        groups.setdefault(key, np.zeros(count, np.bool_))[piece.faces] = True
    return [(dict(key), mask) for key, mask in groups.items()]


def _masked(uv: Float64s, mask: Bools) -> Float64s:
    return np.where(mask[:, None, None], uv, np.nan)


def _refusal(
    source: Asset, layouts: Layouts, clashes: dict[tuple[int, int], int], output: Path, about: str
) -> OptionError:
    """The error for layouts that overlap, which names the pair with the most texels in common."""
    pair = max(clashes, key=lambda clash: clashes[clash])
    one = layouts.pieces[pair[0]]
    other = layouts.pieces[pair[1]]
    by_material = one.material.key != other.material.key
    names = " and ".join(piece.material.name if by_material else piece.object.name for piece in (one, other))
    more = f" ({len(clashes) - 1} more such pairs)" if len(clashes) > 1 else ""
    expected = f"{MATERIAL if by_material else OBJECT} in its name, a .glb, or --overlap mean: layouts overlap"
    got = f"{about}{clashes[pair]:,} texels of {output} for both {names}{more}"
    return OptionError("output", expected, got, source.path)


def layout_remarks(baked: ao.BakedTexture, wraps: bool, tiles: bool) -> list[str]:
    """Remarks on the layout of a page that `wraps`, or not. Args: tiles: whether a file for each may be written."""
    facts = baked.facts
    lines = []
    if facts.overlapping > _NOTED * facts.covered:
        mirrored = f"; {facts.mirrored:,} faces are mirrored" if facts.mirrored else ""
        advice = "--uv pack gives each a place of its own"
        share = f"{facts.overlapping / facts.covered:.1%} of the covered texels"
        lines.append(f"faces overlap in {share}{mirrored}; {advice}")
    if facts.outside and wraps:
        advice = f"; {UDIM} in the output's name would keep tiles apart" if tiles and _has_tiles(baked.uv) else ""
        lines.append(f"{facts.outside:,} faces reach out of the unit square and are taken modulo 1{advice}")
    if facts.missed:
        outside = "points lie outside the cage of the fine mesh and take its closest point"
        lines.append(f"{facts.missed:,} {outside}; a larger --cage reaches farther")
    if facts.flat:
        flat = "faces have texture coordinates without area and show texels of other faces"
        lines.append(f"{facts.flat:,} {flat}; --uv unwrap makes new ones")
    return lines


def check_area(source: Asset, page: Page) -> None:
    """Check that a face of the page has an area on it, or nothing would be written. Raises: MeshError."""
    if not have_area(page.uv).any():
        name = page.name or " ".join(page.words.values())
        of_page = f" of {name}" if name else ""
        raise MeshError(source.path, f"texture coordinates{of_page}", "faces with an area on the page", "none")


def lacking(source: Asset, uv: Float64s, needed: Bools, keeps_uv: bool) -> list[str]:
    """The parts of a file without texture coordinates, in a line. Args: needed: (m,), the faces that matter."""
    without = ~on_page(uv) & needed
    if not without.any():
        return []
    without_uv = [piece for piece in source.runs() if without[piece.faces].any()]
    names = list(dict.fromkeys(f"{piece.object.name} ({piece.material.name})" for piece in without_uv))
    instead = "show w, the openness, of their vertices" if keeps_uv else "get no texels"
    what = f"{without.sum():,} faces, of {first_names(names, _LISTED)}, have no texture coordinates and {instead}"
    return [f"{source.path}: {what}; --uv fill{'' if keeps_uv else ' with --mesh-output'} makes some for them"]


def _has_tiles(uv: Float64s) -> bool:
    try:
        return bool(udim_tiles(uv[on_page(uv)], ""))
    except OptionError:
        return False
