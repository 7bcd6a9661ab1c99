"""Scenes made up from the grammar of TOML scenes and of glTF headers, mostly right, wrong here and there."""

import json

import fuzz_seeds
import pytest
from fuzz_mutations import PATHS, toml_text
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from obscurance.raytrace.errors import InputError
from obscurance.scenes.description.read import read_scene
from obscurance.scenes.formats.obj.mtl import read_mtl
from obscurance.scenes.geometry import builtin_shapes, instances

FEW = settings(
    max_examples=25,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=4), inner, max_size=3),
    max_leaves=6,
)


def likely(strategy):
    """A value as it should be, or one in eight times any other."""
    return st.integers(0, 7).flatmap(lambda dice: strategy if dice else ANYTHING)


def table(needed, **optional):
    """A table with some of the optional keys."""
    return likely(
        st.fixed_dictionaries(
            {key: likely(value) for key, value in needed.items()},
            optional={key: likely(value) for key, value in optional.items()},
        )
    )


def many(strategy, longest=4):
    return likely(st.lists(strategy, min_size=1, max_size=longest))


NUMBER = st.floats(-10, 10) | st.integers(-3, 3) | st.sampled_from([1e100, -1e100, 1e-100, 1e308, float("inf")])
SHARE = st.floats(0, 1)
VECTOR = st.lists(NUMBER, min_size=3, max_size=3)
COLOUR = SHARE | st.lists(SHARE, min_size=3, max_size=3)
PATH = st.sampled_from([*PATHS, "square.obj", "sub/quad.glb", "paint.png"])
INDEX = st.integers(0, 3)
WRAP = st.sampled_from(["repeat", "mirrored_repeat", "clamp_to_edge", "clamp"])
PLACE = {"translate": VECTOR, "rotate": VECTOR, "axis": VECTOR, "angle": NUMBER, "scale": NUMBER | VECTOR}
MATERIAL = table(
    {"model": st.sampled_from(["lambert", "phong", "cook_torrance", "oren_nayar", "strauss", "poulin_fournier", "ward",
                               "ashikhmin_shirley", "kajiya"])},
    albedo=COLOUR, two_sided=st.sampled_from([True, "viewer"]),
    k_d=COLOUR, k_s=COLOUR, exponent=NUMBER, m=SHARE, colour=COLOUR, smoothness=SHARE, spacing=NUMBER,
    m_parallel=SHARE, m_perpendicular=SHARE, exponent_parallel=NUMBER, exponent_perpendicular=NUMBER, height=NUMBER,
    correlation_parallel=st.floats(500, 1e5), correlation_perpendicular=st.floats(500, 1e5), eta=COLOUR,
)  # fmt: skip
SCENE = st.fixed_dictionaries(
    {
        "objects": many(
            table({"builtin": st.sampled_from([*builtin_shapes.SOLIDS])}, fineness=NUMBER, size=NUMBER,
                  radius=NUMBER, level=INDEX, material=MATERIAL | st.just("gold"), copies=many(table({}, **PLACE)),
                  **PLACE)
            | table({"mesh": PATH}, texture=PATH, grain=PATH, own_normals=st.booleans(),
                    wrap=WRAP | st.lists(WRAP, max_size=3), material=MATERIAL, **PLACE)
        )
    },
    optional={
        "background": likely(COLOUR),
        "camera": table({}, position=VECTOR, target=VECTOR, up=VECTOR, field_of_view=NUMBER, height=NUMBER,
                        aperture=NUMBER, focus=NUMBER, direction=VECTOR),
        "render": table({}, samples=INDEX, shading=st.sampled_from(["phong", "flat"]),
                        normals=st.sampled_from(["file", "area", "none"]), seed=st.integers()),
        "obscurance": table({}, form=st.sampled_from(["ambient and diffuse", "off"]), baked=PATH, tau=NUMBER,
                            samples=INDEX, half_distance=NUMBER | st.sampled_from(["25%", "inf", "nan%"])),
        "materials": many(st.fixed_dictionaries({"name": st.text(max_size=3)}, optional={"preset": st.just("gold")})),
        "lights": many(table({"light": st.sampled_from(["point", "spot", "directional", "ambient", "sky",
                                                        "environment"])}, position=VECTOR,
                             direction=VECTOR, intensity=COLOUR, range=NUMBER,
                             zenith=COLOUR, horizon=COLOUR, ground=COLOUR, up=VECTOR, image=PATH, turn=NUMBER,
                             half_angle=st.floats(0, 99), exponent=NUMBER)),
    },
)  # fmt: skip
REFERENCE = table(
    {"index": INDEX},
    texCoord=st.integers(0, 3),
    strength=NUMBER,
    extensions=table(
        {},
        KHR_texture_transform=table(
            {}, offset=st.lists(NUMBER, min_size=2, max_size=2), rotation=NUMBER, texCoord=INDEX
        ),
    ),
)
SPARSE = table(
    {
        "count": st.integers(0, 40),
        "indices": table({"bufferView": INDEX, "componentType": st.just(5121)}),
        "values": table({"bufferView": INDEX}),
    }
)
HEADER = st.fixed_dictionaries(
    {},
    optional={
        "scene": INDEX,
        "scenes": many(table({"nodes": st.lists(INDEX, max_size=3)})),
        "nodes": many(table({}, mesh=INDEX, children=st.lists(INDEX, max_size=2), camera=INDEX,
                            name=st.text(max_size=3), translation=VECTOR, scale=VECTOR,
                            rotation=st.lists(SHARE, min_size=4, max_size=4),
                            matrix=st.lists(NUMBER, min_size=16, max_size=16))),
        "meshes": many(table({"primitives": many(table(
            {"attributes": st.dictionaries(st.sampled_from(["POSITION", "NORMAL", "TEXCOORD_0"]), INDEX)},
            indices=INDEX, material=INDEX, mode=st.integers(0, 7)))})),
        "accessors": many(table({"count": st.integers(0, 40) | st.integers(0, 2**60), "bufferView": INDEX,
                                 "type": st.sampled_from(["VEC3", "VEC2", "SCALAR", "MAT4"]),
                                 "componentType": st.sampled_from([5120, 5121, 5122, 5123, 5125, 5126])},
                                byteOffset=st.integers(0, 99), normalized=st.booleans(), sparse=SPARSE | ANYTHING)),
        "bufferViews": many(table({"buffer": st.integers(0, 1), "byteLength": st.integers(0, 400)},
                                  byteOffset=st.integers(0, 99), byteStride=st.integers(0, 64))),
        "images": many(table({}, uri=PATH, bufferView=INDEX)),
        "textures": many(table({}, source=INDEX)),
        "materials": many(table({}, emissiveFactor=VECTOR, pbrMetallicRoughness=table(
            {}, baseColorFactor=st.lists(SHARE, min_size=4, max_size=4), roughnessFactor=NUMBER,
            baseColorTexture=REFERENCE), occlusionTexture=REFERENCE)),
        "cameras": many(table({"type": st.just("perspective"), "perspective": table({"yfov": SHARE})})),
        "extensions": table({"KHR_lights_punctual": table({"lights": many(table(
            {"type": st.sampled_from(["point", "spot"])}, intensity=NUMBER, color=COLOUR, range=NUMBER))})}),
    },
)  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What the scenes may refer to; little work for shapes and copies."""
    inside = tmp_path_factory.mktemp("outside") / "inside"
    for name, content in fuzz_seeds.companions().items():
        (inside / name).parent.mkdir(parents=True, exist_ok=True)
        (inside / name).write_bytes(content)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(builtin_shapes, "MAX_TRIANGLES", 20_000)
        patch.setattr(instances, "MAX_COPIED", 200_000)
        yield inside


def accepted_or_refused(path):
    """Whether the scene was accepted; warnings are errors in all tests."""
    try:
        read_scene(path, (8, 6))
    except InputError as refusal:
        message = str(refusal)
        assert message.isprintable()
        assert message.startswith(str(path.parent))
        assert len(message) < 1500
        return False
    return True


@FEW
@given(SCENE)
def test_toml_scenes(folder, tree):
    (folder / "m.toml").write_text(toml_text(tree))
    accepted_or_refused(folder / "m.toml")


@FEW
@given(HEADER)
def test_gltf_headers(folder, changes):
    header, _ = fuzz_seeds.gltf()
    (folder / "m.gltf").write_text(json.dumps(header | changes, default=str), "utf-8", "surrogatepass")
    accepted_or_refused(folder / "m.gltf")


def test_the_plain_ones_are_accepted(folder):
    (folder / "m.toml").write_text(toml_text(fuzz_seeds.TOML))
    (folder / "m.gltf").write_text(json.dumps(fuzz_seeds.gltf()[0]))
    assert accepted_or_refused(folder / "m.toml")
    assert accepted_or_refused(folder / "m.gltf")


KEYS = ["newmtl", "Kd", "Ke", "Ks", "d", "Tr", "Ns", "Pm", "Pr", "map_Kd", "map_d", "bump"]
WORDS = st.sampled_from([*KEYS, "#", "\\", "-s 1 1", "a"])
LINE = st.lists(WORDS | NUMBER.map(str) | PATH | st.text(max_size=5), max_size=5).map(" ".join)


@FEW
@given(st.lists(LINE, max_size=12).map("\n".join))
def test_material_libraries(tmp_path, text):
    (tmp_path / "m.mtl").write_text(text, encoding="utf-8", errors="replace")
    paints, _ = read_mtl(tmp_path / "m.mtl", lambda name: None)
    for paint in paints.values():
        for value in (*paint.colour, *paint.emission, paint.opacity, paint.metallic, paint.roughness):
            assert 0 <= value <= 1
