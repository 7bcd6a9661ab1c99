"""What stands beside a mesh in a command: tables, cages, occluders, patterns of names, profiles and reports.

Each is written from a sound one, right but for a few values or bytes, and goes through the commands that read it.
"""

import io
import json
import tempfile
from functools import cache
from pathlib import Path

import fuzz_meshes
import numpy as np
from command import obscurance
from fuzz_mutations import NUMBERS, damaged, mutated
from meshes import hills

NAMES = ("hill_low", "hill_high", "a b", "a*", "[x]", "!no", "Größe", "", "a/b", "a" * 300)


def hills_obj(names=("hill_low", "rest")):
    """A height field of two objects, with texture coordinates above the plane of x and y."""
    vertices, faces = hills(6)
    rows = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"vt {x / 2 + 0.5} {y / 2 + 0.5}" for x, y, _ in vertices]
    half = len(faces) // 2
    for name, some in zip(names, (faces[:half], faces[half:]), strict=True):
        rows += [f"o {name}", *("f " + " ".join(f"{corner}/{corner}" for corner in face) for face in some + 1)]
    return "\n".join([*rows, ""]).encode("utf-8", "replace")


@cache
def sound():
    """Name to content of what the commands need: made by the commands themselves."""
    made = {"hills.obj": hills_obj(), "table.csv": "\n".join(f"{x / 9},{x / 9}" for x in range(10)).encode()}
    with tempfile.TemporaryDirectory() as folder:
        inside = Path(folder)
        (inside / "hills.obj").write_bytes(made["hills.obj"])
        bake = ("bake", inside / "hills.obj", "--samples", "4", "--quiet")
        for ending in ("npz", "ply", "glb"):
            obscurance(*bake, "--profile", "-o", inside / f"profile.{ending}")
            made[f"profile.{ending}"] = (inside / f"profile.{ending}").read_bytes()
        obscurance(*bake, "-o", inside / "w.npz", "--report", inside / "report.json")
        made["report.json"] = (inside / "report.json").read_bytes()
        obscurance(*bake[:1], inside / "hills.obj", "--samples", "4", "--output-dir", inside / "out")
        made["batch/manifest.json"] = (inside / "out" / "manifest.json").read_bytes()
    return made


def number(rng):
    return rng.choice((rng.uniform(-1, 2), *NUMBERS))


def table(rng):
    """A falloff's table of two columns."""
    count, scale = rng.choice((0, 1, 2, 3, 10, 10, 10, 100, 1000)), rng.choice((1, 1, 1e-3, 1e6))
    rows = [[k / max(count - 1, 1) * scale, k / max(count - 1, 1)] for k in range(count)]
    for _ in range(rng.choice((0, 1, 1, 3))):
        if rows:
            rng.choice(rows)[rng.randrange(2)] = number(rng)
    if rng.random() < 0.3:
        return "m.npy", _array(rows, rng)
    between, unit = rng.choice((",", ", ", " ", "\t", ";")), rng.choice(("", "", "%"))
    lines = [f"{distance}{unit}{between}{value}" for distance, value in rows]
    lines = fuzz_meshes.wrong_lines(lines or [""], rng) if rng.random() < 0.4 else lines
    content = "\n".join([*lines, ""]).encode("utf-8", "replace")
    return rng.choice(("m.csv", "m.txt")), damaged(content, rng) if rng.random() < 0.3 else content


def _array(rows, rng):
    """The rows as a file of NumPy's, of any type, with or without damage."""
    file, array = io.BytesIO(), np.array(rows, float).reshape(len(rows), 2)
    with np.errstate(all="ignore"):
        array = array.astype(rng.choice(("f8", "f8", "f8", "f4", "f2", "u1", "c16", ">f8", "U9", "?")))
    np.save(file, array[:, :1] if rng.random() < 0.1 else array)
    return damaged(file.getvalue(), rng) if rng.random() < 0.5 else file.getvalue()


def beside(rng):
    """A mesh to be a cage, a finer mesh or an occluder: any of those of the fuzzer, or the hills moved."""
    if rng.random() < 0.5:
        return fuzz_meshes.spoiled(rng)
    rows = hills_obj().decode().splitlines()
    for _ in range(rng.choice((0, 1, 3))):
        rows = fuzz_meshes.wrong_lines(rows, rng)
    scale = rng.choice((1, 1, 1.1, 0, -1, 1e-30, 1e30, 1e200))
    for at, row in enumerate(rows):
        words = row.split(" ")
        if words[0] == "v" and len(words) == 4:
            try:
                rows[at] = "v " + " ".join(str(scale * float(word)) for word in words[1:])
            except ValueError:
                continue
    return "m.obj", "\n".join([*rows, ""]).encode("utf-8", "replace")


def named(rng):
    """The hills, its objects by other names."""
    return "m.obj", hills_obj([rng.choice(NAMES), rng.choice(NAMES)])


def profile(rng):
    """A bake with a profile: any bytes changed, or arrays of other numbers, types and shapes."""
    name = rng.choice(("profile.npz", "profile.npz", "profile.npz", "profile.ply", "profile.glb"))
    content = sound()[name]
    if name != "profile.npz" or rng.random() < 0.2:
        return name, damaged(content, rng)
    with np.load(io.BytesIO(content)) as file:
        arrays = dict(file)
    for _ in range(rng.choice((1, 1, 2))):
        key = rng.choice(sorted(arrays))
        array = arrays[key].copy()
        match rng.randrange(6):
            case 0:
                arrays.pop(key) if len(arrays) > 1 else None
                continue
            case 1:
                array = array.reshape(-1)[: rng.randrange(array.size + 1)]
            case 2 if array.dtype.kind != "c":
                array = array.astype(rng.choice(("f2", "i8", "c16", "U5", "?", "S3", "u1")))
            case 3:
                array = array[..., None]
            case 4 if array.dtype.kind == "f" and array.size:
                array.reshape(-1)[rng.randrange(array.size)] = number(rng) % 1e30
            case _:
                array = np.asarray(rng.choice((0, "x", np.nan, [], [[1.0, 2.0]])))
        arrays[key] = array
    file = io.BytesIO()
    np.savez(file, **arrays)
    return name, file.getvalue()


def stored(rng):
    """A report, or the manifest of a batch, with other values."""
    name = rng.choice(("report.json", "batch/manifest.json"))
    tree = mutated(json.loads(sound()[name]), rng)
    content = json.dumps(tree).encode("utf-8", "surrogatepass")
    return name, damaged(content, rng) if rng.random() < 0.15 else content


MAKERS = {"table": table, "beside": beside, "named": named, "profile": profile, "stored": stored}
OUTPUTS = (("-o", "w.npz"), ("-o", "w.npz"), ("-o", "w.glb"), ("-o", "w.ply"), ("-o", "w.png", "--size", "16"),
           ("-o", "w.npz", "--method", "surface"), ("-o", "w.npz", "--tolerance", ".05"))  # fmt: skip
LENGTHS = ("5%", "0", "-1", "1e-320", "5e-324", "1e308", "inf", "nan", "1e-9", "100000%", "%", "", "x", "0.3", "1e-3%")
PATTERNS = ("*", "hill*", "!hill*", "rest", "[", "[a", "[!a]*", "**", "?", "!", "!!", "", "a*", "a\\*", "\x1b[31m", "(",
            "*" * 40, "[x]", "Gr*e", "a b")  # fmt: skip
WILD = {
    "--half-distance": LENGTHS, "--max-distance": LENGTHS, "--tau": ("0", "-1", "1e308", "1e-308", "nan", "3"),
    "--falloff": ("binary", "linear", "smooth", "exponential", "table:", "table:none.csv", "table:hills.obj"),
    "--ground": ("auto", "0", "-1", "-1e300", "nan", "inf", "-0.8"), "--receive": PATTERNS, "--cast": PATTERNS,
    "--exclude": PATTERNS, "--occluded-by": ("object", "name", "all"), "--spread": ("1", "180", "0", "90", "nan"),
    "--normals": ("file", "area", "equal"), "--interior": ("mark", "fill", "ignore"), "--seed": ("-1", "3", "1e9"),
    "--back-faces": ("ignore",), "--up": ("-x", "z"), "--samples": ("1", "0", "3", "17"),
}  # fmt: skip


def commands(family, path, made, rng):
    """The arguments of each command that reads the file, and the file that it is to make."""
    inside = path.parent if path.parent.name != "batch" else path.parent.parent
    mesh = inside / "hills.obj"
    base = ["--samples", "4", "--quiet", "--threads", "2"]
    output = [str(made / word) if word.startswith("w.") else word for word in rng.choice(OUTPUTS)]
    target = Path(output[1])
    match family:
        case "table":
            yield ["bake", mesh, *base, "--falloff", f"table:{path}", *output], target
        case "beside":
            yield ["bake", mesh, *base, "--occluder", path, *output], target
            plain = output if "--method" not in output else output[:2]
            yield ["bake", mesh, *base, "--high", path, "--cage", rng.choice((*LENGTHS, "2%", "2%")), *plain], target
            yield ["bake", mesh, *base, "--high", mesh, "--cage", path, *plain], target
            yield ["bake", path, *base, "--high", mesh, "--match-names", *plain], target
        case "named":
            for _ in range(3):
                words = []
                for option in rng.sample(sorted(WILD), rng.choice((1, 1, 2, 3))):
                    words.append(f"{option}={rng.choice(WILD[option])}")
                yield ["bake", path, "--quiet", "--threads", "2", "--samples=4", *words, *output], target
        case "profile":
            where = ["--mesh", mesh] if path.suffix == ".npz" else []
            changed = made / f"w{path.suffix}"
            yield ["falloff", path, "--half-distance", rng.choice((*LENGTHS, *["30%"] * 20)), "-o", changed], changed
            yield ["view", path, *where, "-o", made / "page.html"], made / "page.html"
        case "stored":
            yield ["bake", mesh, "--quiet", "--samples=4", "--options", path, "-o", made / "w.npz"], made / "w.npz"
