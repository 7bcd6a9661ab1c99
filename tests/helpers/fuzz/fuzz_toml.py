"""TOML scenes with wrong, extreme and enormous values of every key that scenes have."""

import copy
from functools import cache

import fuzz_seeds
from fuzz_gltf import rows_of
from fuzz_meshes import wrong_lines
from fuzz_mutations import LONGEST, NUMBERS, OTHERS, PATHS, mutated, toml_text


@cache
def _tables_of_scenes():
    """The keys of every kind of table in a scene file."""
    from typing import get_args

    from obscurance.raytrace.brdf.registry import reflection_models
    from obscurance.raytrace.lights.sources import Light
    from obscurance.raytrace.settings import Settings
    from obscurance.raytrace.system.records import fields_of
    from obscurance.scenes.description import schema
    from obscurance.scenes.geometry.builtin_shapes import SOLIDS

    def members(union):
        found = get_args(union)
        return [member for part in found for member in members(part)] if found else [union] * isinstance(union, type)

    tables = {name: list(fields_of(getattr(schema, name))) for name in ("Document", "Transform", "ObjectTable")}
    tables |= {"camera": list(fields_of(schema.CameraTable)), "render": list(fields_of(Settings))}
    tables |= {"obscurance": list(fields_of(schema.ObscuranceTable))}
    tables |= {"lights": {fields_of(kind)["light"].default: list(fields_of(kind)) for kind in members(Light)}}
    tables |= {"materials": {fields_of(kind)["model"].default: list(fields_of(kind)) for kind in reflection_models()}}
    return tables | {"solids": {name: list(fields_of(kind)) for name, kind in SOLIDS.items()}}


def _length(rng):
    return 10 ** rng.uniform(-5, 4)


TEXTS = ["gold", "glaze", "repeat", "clamp", "book", "off", "ambient", "25%", "-5%", "1e999%", "inf", "nan", "viewer",
         "phong", "flat", "gouraud", "quadratic", "constant", "file", "angle", "exponential", "binary", "linear",
         "smooth", "table:w.npy", "table:falloff.csv", "square.obj", "sub/quad.glb", "paint.png", "sky.png", "huge.png",
         "alpha.png", "w.npz", "many.obj"]  # fmt: skip


def _value(rng):
    match rng.randrange(10):
        case 0 | 1 | 2:
            return rng.choice((_length(rng), -_length(rng), rng.randrange(-2, 40), rng.random()))
        case 3:
            return rng.choice(NUMBERS)
        case 4 | 5:
            return [
                rng.choice((0, 1, -1, 0.5, _length(rng), rng.choice(NUMBERS))) for _ in range(rng.choice((3, 3, 2, 4)))
            ]
        case 6:
            return rng.choice(TEXTS)
        case 7:
            return rng.choice(PATHS)
        case 8:
            return rng.choice((True, False))
        case _:
            return copy.deepcopy(rng.choice(OTHERS))


def spoiled(rng):
    tree = copy.deepcopy(rng.choice((fuzz_seeds.TOML, fuzz_seeds.TOML, fuzz_seeds.BAKED)))
    for _ in range(rng.choice((1, 1, 2, 3, 5))):
        rng.choice((_key, _key, _key, _solid, _solid, _copies, _light, _material, _other))(tree, rng)
    text = toml_text(tree)
    if rng.random() < 0.1 and len(text) < LONGEST:
        text = "\n".join(
            wrong_lines(text.split("\n"), rng, ("[camera]", "[[objects]]", "objects = []", "a.b.c = 1", "["))
        )
    return "m.toml", text.encode("utf-8", "replace")


def _key(tree, rng):
    """Any key of any table."""
    tables = _tables_of_scenes()
    kind = rng.choice(("Document", "camera", "render", "obscurance", "objects", "objects", "lights", "materials"))
    if kind == "Document":
        tree[rng.choice(tables[kind])] = _value(rng)
    elif kind in ("camera", "render", "obscurance"):
        table = tree.setdefault(kind, {})
        if isinstance(table, dict):
            table[rng.choice(tables[kind])] = _value(rng)
    elif rows := rows_of(tree, kind):
        row = rng.choice(rows)
        known = tables["ObjectTable"] if kind == "objects" else [key for each in tables[kind].values() for key in each]
        row[rng.choice(known)] = _value(rng)


def _solid(tree, rng):
    """A built-in shape of any size and fineness."""
    kind, keys = rng.choice(list(_tables_of_scenes()["solids"].items()))
    row = {"builtin": kind}
    for key in keys:
        if rng.random() < 0.5:
            row[key] = rng.choice(
                (_length(rng), [_length(rng) for _ in range(3 if kind == "box" else 2)], 2, _value(rng))
            )
    if isinstance(tree.get("objects"), list):
        tree["objects"].append(row)


def _copies(tree, rng):
    if rows := rows_of(tree, "objects"):
        keys = _tables_of_scenes()["Transform"]
        count = rng.choice((1, 2, 20, 400, 4000, 20_000))
        odd = {rng.choice(keys): _value(rng)}
        rng.choice(rows)["copies"] = [{"translate": [n, 0, 0]} for n in range(count)] + [odd] * (rng.random() < 0.3)


def _light(tree, rng):
    kind, keys = rng.choice(list(_tables_of_scenes()["lights"].items()))
    row = {"position": [0, 0, 3], "direction": [0, 0, -1], "half_angle": 30.0, "zenith": 1.0, "horizon": 0.5}
    row = {key: value for key, value in row.items() if key in keys} | {"light": kind}
    if "image" in keys:
        row["image"] = rng.choice(("sky.png", "huge.png", "paint.png", "none.png"))
    if rng.random() < 0.7:
        row[rng.choice(keys)] = _value(rng)
    if isinstance(tree.get("lights", []), list):
        tree["lights"] = [*tree.get("lights", []), *[row] * rng.choice((1, 1, 1, 40))]


def _material(tree, rng):
    kind, keys = rng.choice(list(_tables_of_scenes()["materials"].items()))
    row = {"model": kind}
    for key in keys:
        if rng.random() < 0.7:
            row[key] = rng.choice(
                (rng.random(), [rng.random() for _ in range(3)], 10 ** rng.uniform(-3, 4), _value(rng))
            )
    if rows := rows_of(tree, "objects"):
        rng.choice(rows)["material"] = row


def _other(tree, rng):
    changed = mutated(tree, rng, toml=True)
    tree.clear()
    tree.update(changed)
