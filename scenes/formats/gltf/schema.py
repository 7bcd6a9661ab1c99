"""Types of the part of a glTF header that is read; whatever does not match is refused by name.

Indices are whole numbers from 0; whether they point at something is found where they are used.
Format: Khronos glTF 2.0 specification, section 5.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from raytrace.errors import MeshError
from raytrace.system.faults import first_fault

from ...field_errors import shown

Whole = Annotated[int, Field(strict=True, ge=0, lt=2**53)]
Number = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-1e100, le=1e100)]
Vector = tuple[Number, Number, Number]
Quadruple = tuple[Number, Number, Number, Number]
T = TypeVar("T")
Many = Annotated[list[T], Field(fail_fast=True)]  # the first fault is enough
Text = Annotated[str, Field(strict=True)]
WrapMode = Literal[10497, 33648, 33071]


class _Table(BaseModel):
    """Base: keys that are not read may be anything."""

    model_config = ConfigDict(extra="ignore", defer_build=True)


def _version_two(value: str) -> str:
    if not value.startswith("2."):
        raise ValueError("glTF 2.0")
    return value


class _Asset(_Table):
    version: Annotated[Text, AfterValidator(_version_two)]


class _Scene(_Table):
    nodes: Many[Whole] = []


class _Node(_Table):
    name: Text = ""
    children: Many[Whole] = []
    mesh: Whole = 0
    matrix: Annotated[list[Number], Field(min_length=16, max_length=16)] = []
    translation: Vector = (0, 0, 0)
    rotation: Quadruple = (0, 0, 0, 1)
    scale: Vector = (1, 1, 1)
    extensions: dict[str, Any] = {}


class _Primitive(_Table):
    attributes: dict[str, Whole]
    indices: Whole = 0
    material: Whole = 0
    mode: Whole = 4


class _Mesh(_Table):
    name: Text = ""
    primitives: Many[_Primitive]


class _Part(_Table):
    bufferView: Whole
    byteOffset: Whole = 0


class _Indices(_Part):
    componentType: Whole


class _Sparse(_Table):
    count: Annotated[Whole, Field(ge=1)]
    indices: _Indices
    values: _Part


class _Accessor(_Table):
    sparse: _Sparse | None = None
    bufferView: Whole = 0
    byteOffset: Whole = 0
    componentType: Whole
    count: Whole
    type: Text
    normalized: bool = False


class _View(_Table):
    buffer: Whole
    byteOffset: Whole = 0
    byteLength: Whole
    byteStride: Whole = 0
    extensions: dict[str, Any] = {}


class _Fallback(_Table):
    fallback: bool = False


class _BufferExtensions(_Table):
    EXT_meshopt_compression: _Fallback = _Fallback()
    KHR_meshopt_compression: _Fallback = _Fallback()


class _Buffer(_Table):
    extensions: _BufferExtensions = _BufferExtensions()
    uri: Text = ""
    byteLength: Whole


class _Image(_Table):
    uri: Text = ""
    bufferView: Whole = 0


class _Geometry(_Table):
    asset: _Asset
    extensionsUsed: Many[Text] = []
    extensionsRequired: Many[Text] = []
    scene: Whole = 0
    scenes: Many[_Scene] = []
    nodes: Many[_Node] = []
    meshes: Many[_Mesh] = []
    accessors: Many[_Accessor] = []
    bufferViews: Many[_View] = []
    buffers: Many[_Buffer] = []
    images: Many[_Image] = []


class _PlacedLight(_Table):
    light: Whole | None = None


class _NodeExtensions(_Table):
    KHR_lights_punctual: _PlacedLight = _PlacedLight()


class _Holder(_Table):
    camera: Whole = 0
    extensions: _NodeExtensions = _NodeExtensions()


class _Texture(_Table):
    source: Whole | None = None
    sampler: Whole = 0


class _Sampler(_Table):
    wrapS: WrapMode = 10497
    wrapT: WrapMode = 10497


class _Transform(_Table):
    offset: tuple[Number, Number] = (0, 0)
    rotation: Number = 0
    scale: tuple[Number, Number] = (1, 1)
    texCoord: Whole = 0


class _ReferenceExtensions(_Table):
    KHR_texture_transform: _Transform = _Transform()


class _TextureReference(_Table):
    index: Whole
    texCoord: Whole = 0
    extensions: _ReferenceExtensions = _ReferenceExtensions()


class _OcclusionReference(_TextureReference):
    strength: Number = 1


class _Surface(_Table):
    baseColorFactor: Quadruple = (1, 1, 1, 1)
    baseColorTexture: _TextureReference | None = None
    metallicFactor: Number = 1
    roughnessFactor: Number = 1
    metallicRoughnessTexture: _TextureReference | None = None


class _SpecularGlossiness(_Table):
    diffuseFactor: Quadruple = (1, 1, 1, 1)
    diffuseTexture: _TextureReference | None = None
    specularFactor: Vector = (1, 1, 1)
    glossinessFactor: Number = 1
    specularGlossinessTexture: _TextureReference | None = None


class _Strength(_Table):
    emissiveStrength: Number = 1


class _MaterialExtensions(_Table):
    KHR_materials_emissive_strength: _Strength = _Strength()
    KHR_materials_pbrSpecularGlossiness: _SpecularGlossiness | None = None


class _Material(_Table):
    alphaMode: Literal["OPAQUE", "MASK", "BLEND"] = "OPAQUE"
    alphaCutoff: Annotated[Number, Field(ge=0, le=1)] = 0.5
    occlusionTexture: _OcclusionReference | None = None
    pbrMetallicRoughness: _Surface = _Surface()
    emissiveFactor: Vector = (0, 0, 0)
    emissiveTexture: _TextureReference | None = None
    extensions: _MaterialExtensions = _MaterialExtensions()


class _Perspective(_Table):
    yfov: Number


class _Orthographic(_Table):
    ymag: Number


class _PerspectiveCamera(_Table):
    type: Literal["perspective"]
    perspective: _Perspective


class _OrthographicCamera(_Table):
    type: Literal["orthographic"]
    orthographic: _Orthographic


class _Spot(_Table):
    innerConeAngle: Number = 0
    outerConeAngle: Number = 1


class _Light(_Table):
    type: Text
    color: Vector = (1, 1, 1)
    intensity: Number = 1
    range: Number | None = None
    spot: _Spot = _Spot()


class _Lights(_Table):
    lights: Many[_Light]


class _Extensions(_Table):
    KHR_lights_punctual: _Lights | None = None


class _Appearance(_Table):
    nodes: Many[_Holder] = []
    textures: Many[_Texture] = []
    samplers: Many[_Sampler] = []
    materials: Many[_Material] = []
    cameras: Many[Annotated[_PerspectiveCamera | _OrthographicCamera, Field(discriminator="type")]] = []
    extensions: _Extensions = _Extensions()


class _Mapping(_Table):
    material: Whole = 0


class _Variants(_Table):
    mappings: Many[_Mapping] = []


class _PrimitiveExtensions(_Table):
    KHR_materials_variants: _Variants = _Variants()


class _MaterialPrimitive(_Table):
    targets: Many[dict[str, Whole]] = []
    extensions: _PrimitiveExtensions = _PrimitiveExtensions()


class _MaterialMesh(_Table):
    primitives: Many[_MaterialPrimitive]


class _Materials(_Table):
    meshes: Many[_MaterialMesh] = []
    textures: Many[_Texture] = []
    samplers: Many[dict[str, Any]] = []
    materials: Many[_Material] = []


def check_geometry(header: Any, source: object) -> None:
    """What a mesh needs. Raises: MeshError: the first value that is not of its type, by its path."""
    _check(_Geometry, header, source)


def check_appearance(header: Any, source: object) -> None:
    """What a picture needs besides. Raises: MeshError: the first value that is not of its type, by its path."""
    _check(_Appearance, header, source)


def check_materials(header: Any, source: object) -> None:
    """What a change of materials needs. Raises: MeshError: the first value that is not of its type, by its path."""
    _check(_Materials, header, source)


def _check(kind: type[_Table], header: Any, source: object) -> None:
    try:
        kind.model_validate(header)
    except ValidationError as error:
        path, expected, got, _ = first_fault(error, kind, shown)
        expected = "an object" if expected == "a table" else expected  # as JSON calls it
        raise MeshError(source, path or "content", expected, got) from None
