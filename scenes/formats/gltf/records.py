"""The part of a glTF header that is read, as records; here, and nowhere else, stand the specification's defaults.

Whole numbers are indices and sizes, from 0; whether they point at something is found where they are used. What does not
match is refused by name. Format: Khronos glTF 2.0 specification, section 5; of extensions KHR_lights_punctual,
KHR_texture_transform, EXT_texture_webp, KHR_texture_basisu, EXT_texture_avif, KHR_materials_emissive_strength,
KHR_materials_pbrSpecularGlossiness, KHR_materials_variants, KHR_materials_transmission, KHR_draco_mesh_compression,
meshopt_compression.
"""

# ruff: noqa: RUF012 (empty lists as defaults are shared, and never changed)
from math import pi
from typing import Annotated, Any, Literal, TypeVar

from obscurance.raytrace.errors import MeshError
from obscurance.raytrace.system.records import At, Fault, Record, Within, read

from ...asset.primitive import BAKED
from ...json_toml import shown

T = TypeVar("T")
Index = Annotated[int, Within(0, 2**53 - 1, words="a whole number, 0 or more")]
Number = Annotated[float, Within(-1e100, 1e100, words="a finite number")]
Vector = tuple[Number, Number, Number]
Quadruple = tuple[Number, Number, Number, Number]
Matrix = tuple[
    Number, Number, Number, Number, Number, Number, Number, Number,
    Number, Number, Number, Number, Number, Number, Number, Number,
]  # fmt: skip
LEFT = {column: f"_{column.upper()}" for column in BAKED.values()}  # attributes of what a bake leaves
PROFILE = "_OBSCURANCE_PROFILE_"  # and a number: attributes of four columns each
WRAP = 10497  # REPEAT
LIGHTS = "extensions.KHR_lights_punctual.lights"
TRANSMISSION = "KHR_materials_transmission"
TRIANGLE_MODES = TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN = 4, 5, 6


def parse(kind: type[T], value: Any, source: object) -> T:
    """`value` as `kind`. Raises: MeshError: the first value that is not of its type, by its path."""
    try:
        return read(kind, value)
    except Fault as fault:
        raise MeshError(source, fault.place or "content", fault.expected, shown(fault.got)) from None


class GltfScene(Record):
    nodes: list[Index] = []


class Node(Record):
    name: str = ""
    children: list[Index] = []
    mesh: Index | None = None
    skin: Index | None = None
    weights: list[Number] = []
    matrix: Matrix | None = None  # column by column
    translation: Vector = (0, 0, 0)
    rotation: Quadruple | None = None
    scale: Vector = (1, 1, 1)
    camera: Index | None = None
    light: Annotated[Index | None, At("extensions.KHR_lights_punctual.light")] = None
    extensions: dict[str, Any] = {}


class Variant(Record):
    material: Index | None = None


class Primitive(Record):
    attributes: dict[str, Index]
    indices: Index | None = None
    material: Index | None = None
    mode: Index = TRIANGLES
    targets: list[dict[str, Index]] = []
    draco: Annotated[Index | None, At("extensions.KHR_draco_mesh_compression.bufferView")] = None
    draco_attributes: Annotated[dict[str, Index], At("extensions.KHR_draco_mesh_compression.attributes")] = {}
    variants: Annotated[list[Variant], At("extensions.KHR_materials_variants.mappings")] = []


class GltfMesh(Record):
    name: str = ""
    primitives: list[Primitive]
    weights: list[Number] = []


class Skin(Record):
    joints: list[Index]
    inverseBindMatrices: Index | None = None


class Sparse(Record):
    count: Index
    view: Annotated[Index, At("values.bufferView")]
    offset: Annotated[Index, At("values.byteOffset")] = 0
    index_view: Annotated[Index, At("indices.bufferView")]
    index_offset: Annotated[Index, At("indices.byteOffset")] = 0
    index_type: Annotated[Index, At("indices.componentType")]


class Accessor(Record):
    sparse: Sparse | None = None
    bufferView: Index | None = None
    byteOffset: Index = 0
    componentType: Index
    count: Index
    type: str
    normalized: Any = False
    extras: Any = None


class BufferView(Record):
    buffer: Index
    byteOffset: Index = 0
    byteLength: Index
    byteStride: Index = 0
    extensions: dict[str, Any] = {}


class Buffer(Record):
    fallback: Annotated[bool, At("extensions.EXT_meshopt_compression.fallback")] = False
    khr_fallback: Annotated[bool, At("extensions.KHR_meshopt_compression.fallback")] = False
    uri: str | None = None
    byteLength: Index


class Image(Record):
    uri: str = ""
    bufferView: Index | None = None


class GltfAsset(Record):
    version: Annotated[Any, At("asset.version")]


class GltfGeometry(Record):
    """The part of a header that a mesh needs."""

    extensionsUsed: list[str] = []
    extensionsRequired: list[str] = []
    scene: Index = 0
    scenes: list[GltfScene] = []
    nodes: list[Node] = []
    meshes: list[GltfMesh] = []
    skins: list[Skin] = []
    accessors: list[Accessor] = []
    bufferViews: list[BufferView] = []
    buffers: list[Buffer] = []
    images: list[Image] = []


class GltfTexture(Record):
    source: Index | None = None
    webp: Annotated[Index | None, At("extensions.EXT_texture_webp.source")] = None
    ktx2: Annotated[Index | None, At("extensions.KHR_texture_basisu.source")] = None
    avif: Annotated[Index | None, At("extensions.EXT_texture_avif.source")] = None
    extensions: dict[str, Any] = {}
    sampler: Index | None = None

    @property
    def image(self) -> int | None:
        """Number of the image in a format that is read."""
        return self.webp if self.source is None else self.source

    @property
    def unreadable(self) -> int | None:
        """Number of the image in a format that is not read."""
        return self.avif if self.ktx2 is None else self.ktx2


class Sampler(Record):
    wrapS: Any = WRAP
    wrapT: Any = WRAP


class UvTransform(Record):
    offset: tuple[Number, Number] = (0, 0)
    rotation: Number = 0
    scale: tuple[Number, Number] = (1, 1)
    texCoord: Index | None = None


class TextureReference(Record):
    index: Index
    texCoord: Index = 0
    transform: Annotated[UvTransform, At("extensions.KHR_texture_transform")] = UvTransform()


class OcclusionReference(TextureReference):
    strength: Number = 1


class MetallicRoughness(Record):
    baseColorFactor: Quadruple = (1, 1, 1, 1)
    baseColorTexture: TextureReference | None = None
    metallicFactor: Number = 1
    roughnessFactor: Number = 1
    metallicRoughnessTexture: TextureReference | None = None


class SpecularGlossiness(Record):
    diffuseFactor: Quadruple = (1, 1, 1, 1)
    diffuseTexture: TextureReference | None = None
    specularFactor: Vector = (1, 1, 1)
    glossinessFactor: Number = 1
    specularGlossinessTexture: TextureReference | None = None


class Transmission(Record):
    transmissionFactor: Number = 0
    transmissionTexture: TextureReference | None = None


class GltfMaterial(Record):
    extensions: dict[str, Any] = {}
    name: Any = ""
    alphaMode: Literal["OPAQUE", "MASK", "BLEND"] = "OPAQUE"
    alphaCutoff: Annotated[float, Within(0, 1)] = 0.5
    doubleSided: Any = False
    normalTexture: Any = None
    occlusionTexture: OcclusionReference | None = None
    pbrMetallicRoughness: MetallicRoughness = MetallicRoughness()
    emissiveFactor: Vector = (0, 0, 0)
    emissiveTexture: TextureReference | None = None
    emissiveStrength: Annotated[Number, At("extensions.KHR_materials_emissive_strength.emissiveStrength")] = 1
    transmission: Annotated[Transmission, At(f"extensions.{TRANSMISSION}")] = Transmission()
    specular: Annotated[SpecularGlossiness | None, At("extensions.KHR_materials_pbrSpecularGlossiness")] = None

    @property
    def base(self) -> tuple[Quadruple, TextureReference | None]:
        """Factor and texture of the base colour, or of what stands in its place."""
        if self.specular:
            return self.specular.diffuseFactor, self.specular.diffuseTexture
        return self.pbrMetallicRoughness.baseColorFactor, self.pbrMetallicRoughness.baseColorTexture


class GltfMaterials(Record):
    """The part of a header that materials need."""

    textures: list[GltfTexture] = []
    samplers: list[Sampler] = []
    materials: list[GltfMaterial] = []


class GltfCamera(Record):
    type: Literal["perspective", "orthographic"]
    yfov: Annotated[Number, At("perspective.yfov")] = 0  # radians
    ymag: Annotated[Number, At("orthographic.ymag")] = 0


class GltfLight(Record):
    type: str
    color: Vector = (1, 1, 1)
    intensity: Number = 1
    range: Number | None = None
    innerConeAngle: Annotated[Number, At("spot.innerConeAngle")] = 0  # radians
    outerConeAngle: Annotated[Number, At("spot.outerConeAngle")] = pi / 4


class Stage(Record):
    """Cameras and lights of a header."""

    cameras: list[GltfCamera] = []
    lights: Annotated[list[GltfLight], At(LIGHTS)] = []
