"""The part of a glTF header that is read, as records; here, and nowhere else, stand the specification's defaults.

Format: Khronos glTF 2.0 specification, section 5; of extensions KHR_lights_punctual, KHR_texture_transform,
KHR_materials_emissive_strength, KHR_materials_pbrSpecularGlossiness, KHR_materials_variants, meshopt_compression.
"""

# ruff: noqa: RUF012 (empty lists as defaults are shared, and never changed)
from math import pi
from typing import Annotated, Any, Literal

from .parse import JsonObject, UnitNumber

Vector = tuple[float, float, float]
Quadruple = tuple[float, float, float, float]
Matrix = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float, float, float, float, float
]
PROFILE = "_OBSCURANCE_PROFILE_"  # and a number: attributes of four columns each
WRAP = 10497  # REPEAT
LIGHTS = "extensions.KHR_lights_punctual.lights"
TRIANGLES, TRIANGLE_STRIP, TRIANGLE_FAN = 4, 5, 6


class GltfScene(JsonObject):
    nodes: list[int] = []


class Node(JsonObject):
    name: str = ""
    children: list[int] = []
    mesh: int | None = None
    skin: int | None = None
    weights: list[float] = []
    matrix: Matrix | None = None  # column by column
    translation: Vector = (0, 0, 0)
    rotation: Quadruple | None = None
    scale: Vector = (1, 1, 1)
    camera: int | None = None
    light: Annotated[int | None, "extensions.KHR_lights_punctual.light"] = None
    extensions: dict[str, Any] = {}


class Variant(JsonObject):
    material: int | None = None


class Primitive(JsonObject):
    attributes: dict[str, int]
    indices: int | None = None
    material: int | None = None
    mode: int = TRIANGLES
    targets: list[dict[str, int]] = []
    variants: Annotated[list[Variant], "extensions.KHR_materials_variants.mappings"] = []


class GltfMesh(JsonObject):
    name: str = ""
    primitives: list[Primitive]
    weights: list[float] = []


class Skin(JsonObject):
    joints: list[int]
    inverseBindMatrices: int | None = None


class Sparse(JsonObject):
    count: int
    view: Annotated[int, "values.bufferView"]
    offset: Annotated[int, "values.byteOffset"] = 0
    index_view: Annotated[int, "indices.bufferView"]
    index_offset: Annotated[int, "indices.byteOffset"] = 0
    index_type: Annotated[int, "indices.componentType"]


class Accessor(JsonObject):
    sparse: Sparse | None = None
    bufferView: int | None = None
    byteOffset: int = 0
    componentType: int
    count: int
    type: str
    normalized: bool = False
    extras: Any = None


class BufferView(JsonObject):
    buffer: int
    byteOffset: int = 0
    byteLength: int
    byteStride: int = 0
    extensions: dict[str, Any] = {}


class Buffer(JsonObject):
    fallback: Annotated[bool, "extensions.EXT_meshopt_compression.fallback"] = False
    khr_fallback: Annotated[bool, "extensions.KHR_meshopt_compression.fallback"] = False
    uri: str | None = None
    byteLength: int


class Image(JsonObject):
    uri: str = ""
    bufferView: int | None = None


class GltfGeometry(JsonObject):
    """The part of a header that a mesh needs."""

    version: Annotated[str, "asset.version"]
    extensionsUsed: list[str] = []
    extensionsRequired: list[str] = []
    scene: int = 0
    scenes: list[GltfScene] = []
    nodes: list[Node] = []
    meshes: list[GltfMesh] = []
    skins: list[Skin] = []
    accessors: list[Accessor] = []
    bufferViews: list[BufferView] = []
    buffers: list[Buffer] = []
    images: list[Image] = []


class GltfTexture(JsonObject):
    source: int | None = None
    sampler: int | None = None


class Sampler(JsonObject):
    wrapS: Any = WRAP
    wrapT: Any = WRAP


class UvTransform(JsonObject):
    offset: tuple[float, float] = (0, 0)
    rotation: float = 0
    scale: tuple[float, float] = (1, 1)
    texCoord: int | None = None


class TextureReference(JsonObject):
    index: int
    texCoord: int = 0
    transform: Annotated[UvTransform, "extensions.KHR_texture_transform"] = UvTransform()


class OcclusionReference(TextureReference):
    strength: float = 1


class MetallicRoughness(JsonObject):
    baseColorFactor: Quadruple = (1, 1, 1, 1)
    baseColorTexture: TextureReference | None = None
    metallicFactor: float = 1
    roughnessFactor: float = 1
    metallicRoughnessTexture: TextureReference | None = None


class SpecularGlossiness(JsonObject):
    diffuseFactor: Quadruple = (1, 1, 1, 1)
    diffuseTexture: TextureReference | None = None
    specularFactor: Vector = (1, 1, 1)
    glossinessFactor: float = 1
    specularGlossinessTexture: TextureReference | None = None


class GltfMaterial(JsonObject):
    extensions: dict[str, Any] = {}
    name: Any = ""
    alphaMode: Literal["OPAQUE", "MASK", "BLEND"] = "OPAQUE"
    alphaCutoff: UnitNumber = UnitNumber(0.5)
    doubleSided: Any = False
    normalTexture: Any = None
    occlusionTexture: OcclusionReference | None = None
    pbrMetallicRoughness: MetallicRoughness = MetallicRoughness()
    emissiveFactor: Vector = (0, 0, 0)
    emissiveTexture: TextureReference | None = None
    emissiveStrength: Annotated[float, "extensions.KHR_materials_emissive_strength.emissiveStrength"] = 1
    specular: Annotated[SpecularGlossiness | None, "extensions.KHR_materials_pbrSpecularGlossiness"] = None

    @property
    def base(self) -> tuple[Quadruple, TextureReference | None]:
        """Factor and texture of the base colour, or of what stands in its place."""
        if self.specular:
            return self.specular.diffuseFactor, self.specular.diffuseTexture
        return self.pbrMetallicRoughness.baseColorFactor, self.pbrMetallicRoughness.baseColorTexture


class GltfMaterials(JsonObject):
    """The part of a header that materials need."""

    textures: list[GltfTexture] = []
    samplers: list[Sampler] = []
    materials: list[GltfMaterial] = []


class GltfCamera(JsonObject):
    type: Literal["perspective", "orthographic"]
    yfov: Annotated[float, "perspective.yfov"] = 0  # radians
    ymag: Annotated[float, "orthographic.ymag"] = 0


class GltfLight(JsonObject):
    type: str
    color: Vector = (1, 1, 1)
    intensity: float = 1
    range: float | None = None
    innerConeAngle: Annotated[float, "spot.innerConeAngle"] = 0  # radians
    outerConeAngle: Annotated[float, "spot.outerConeAngle"] = pi / 4


class Stage(JsonObject):
    """Cameras and lights of a header."""

    cameras: list[GltfCamera] = []
    lights: Annotated[list[GltfLight], LIGHTS] = []
