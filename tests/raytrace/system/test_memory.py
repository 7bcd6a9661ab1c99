"""Work that does not fit into memory is refused before it begins, in one line."""

import re
import resource
import subprocess
import sys

import numpy as np
import pytest
from fuzz_seeds import MODEL, archive
from mesh_files import FACES, VERTICES, ply, stl
from meshes import hills
from project import ROOT

from obscurance import ao, raytrace
from obscurance.ao.memory import surface_bytes, vertex_bytes
from obscurance.raytrace import InputError, Lambert, MemoryLimitError, Mesh, Object, Scene, Settings, Shape
from obscurance.raytrace.renderer import render_scene
from obscurance.raytrace.renderer.render import rendering_bytes
from obscurance.raytrace.system.checks import available_memory, check_memory
from obscurance.scenes.description.obscurance import with_obscurance
from obscurance.scenes.description.read import read_scene
from obscurance.scenes.formats.load import load

MIB = 1 << 20
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="measures by /proc")


def machine(tmp_path, free="8388608", groups="", **files):
    """A made-up `proc` and `sys`. Args: free: kB. files: of a control group, by path with _ for /."""
    (tmp_path / "proc" / "self").mkdir(parents=True)
    (tmp_path / "proc" / "meminfo").write_text(f"MemTotal: 16777216 kB\nMemAvailable: {free} kB\n")
    (tmp_path / "proc" / "self" / "cgroup").write_text(groups)
    for name, content in files.items():
        path = tmp_path / "sys" / "fs" / "cgroup" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(content)
    return tmp_path


def test_the_system_reports_what_is_available(tmp_path):
    assert available_memory(machine(tmp_path)) == 8 << 30


def version_1(limit):
    return {
        "memory/jobs/memory.limit_in_bytes": f"{limit}\n",
        "memory/jobs/memory.usage_in_bytes": f"{300 * MIB}\n",
        "memory/jobs/memory.stat": f"cache 5\ntotal_inactive_file {60 * MIB}\ntotal_active_file {40 * MIB}\n",
    }


def test_a_group_of_version_1_limits_it_and_file_pages_count_as_free(tmp_path):
    root = machine(tmp_path, groups="9:name=systemd:/\n4:memory:/jobs/own\n", **version_1(1000 * MIB))
    assert available_memory(root) == 800 * MIB


def test_no_limit_in_a_group_is_none(tmp_path):
    root = machine(tmp_path, groups="4:cpu,memory:/jobs\n", **version_1(9223372036854771712))
    assert available_memory(root) == 8 << 30


def test_the_tightest_group_of_version_2_counts(tmp_path):
    files = {"memory.max": "max\n", "memory.current": "0\n", "memory.stat": ""}
    for path, limit in (("pod", f"{700 * MIB}\n"), ("pod/own", "max\n")):
        files |= {f"{path}/memory.max": limit, f"{path}/memory.current": f"{900 * MIB}\n"}
        files |= {f"{path}/memory.stat": f"anon 3\ninactive_file {200 * MIB}\nactive_file {50 * MIB}\n"}
    assert available_memory(machine(tmp_path, groups="0::/pod/own\n", **files)) == 50 * MIB


@pytest.mark.parametrize("content", ["", "garbage\n", "1:memory\n"])
def test_what_makes_no_sense_limits_nothing(tmp_path, content):
    root = machine(tmp_path, free="lots", groups=content if content.count(":") == 2 else "")
    (root / "proc" / "meminfo").write_text(content)
    assert available_memory(root) > 0


@LINUX
@pytest.mark.parametrize("kind", [resource.RLIMIT_AS, resource.RLIMIT_DATA], ids=["addresses", "data"])
def test_a_limit_of_the_process_limits_it(kind):
    code = "from obscurance.raytrace.system.checks import available_memory; print(available_memory())"
    limit = 4 << 30
    result = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        preexec_fn=lambda: resource.setrlimit(kind, (limit, limit)),
        cwd=ROOT,
    )
    assert limit - 1024 * MIB < int(result.stdout) < limit - 192 * MIB


def test_the_line_says_what_needs_how_much_and_what_would_do(available_memory):
    available_memory(300 * MIB)
    check_memory("m.ply", 300 * MIB, "to bake")
    with pytest.raises(MemoryLimitError) as caught:
        check_memory("m.ply", 3 << 30, "to bake", {"the first": 400 * MIB, "the other": 200 * MIB})
    assert str(caught.value) == (
        "m.ply: memory: expected at most 300 MiB, what is available,"
        " got about 3.0 GiB to bake; the other takes about 200 MiB"
    )
    with pytest.raises(MemoryLimitError, match="10% of that work would fit"):
        check_memory("m.ply", 3000 * MIB, "to bake", {"the first": 400 * MIB})


def scene(mesh):
    return Scene((Object(Shape(mesh, Lambert(albedo=0.5))),))


WORK = {
    "bake": lambda mesh: ao.bake(mesh, samples=8),
    "tolerance": lambda mesh: ao.bake(mesh, tolerance=0.1),
    "surface": lambda mesh: ao.bake(mesh, samples=8, method="surface"),
    "render": lambda mesh: raytrace.render(
        scene(mesh), raytrace.Camera((0, -5, 5), (0, 0, 0)), Settings(width=64, height=64)
    ),
}


@pytest.mark.parametrize("name", WORK)
def test_everything_big_asks_first(name, available_memory):
    mesh = Mesh(*hills(10), source="hills.ply")
    available_memory(30 * MIB)
    with pytest.raises(MemoryLimitError, match=r"expected at most 30 MiB.* faces"):
        WORK[name](mesh)


@pytest.mark.parametrize("ending", ["ply", "off", "3mf", "glb", "toml"])
def test_files_are_not_read_if_they_would_not_fit(ending, tmp_path, available_memory, monkeypatch):
    import trimesh

    from obscurance.scenes.description.read import read_scene

    path = tmp_path / f"m.{ending}"
    if ending == "ply":
        path.write_bytes(ply(VERTICES, FACES))
    elif ending == "toml":
        (tmp_path / "m.ply").write_bytes(ply(VERTICES, FACES))
        path.write_text('[[objects]]\nmesh = "m.ply"\n')
    elif ending == "3mf":
        path.write_bytes(archive(**{"3D/3dmodel.model": MODEL}))
    else:
        trimesh.creation.icosphere(1).export(path)
    available_memory(100)
    monkeypatch.setattr("obscurance.raytrace.system.checks.NEGLIGIBLE", 0)
    with pytest.raises(InputError, match="memory: expected at most 0 MiB"):
        read_scene(path) if ending == "toml" else load(path)


def test_more_to_do_takes_more():
    assert vertex_bytes(10**6, 2 * 10**6, 256) < vertex_bytes(10**6, 2 * 10**6, 1 << 20)
    assert vertex_bytes(10**6, 2 * 10**6, 256) < surface_bytes(10**6, 2 * 10**6)
    item = scene(Mesh(*hills(4)))
    small, large = (rendering_bytes(item, Settings(width=1024, height=side), True) for side in (1024, 4096))
    assert large - small == 3 * 1024 * 1024 * 104 + 3 * 64 * 64 * 1696  # pixels, and edges of tiles


@pytest.mark.parametrize(("room", "kept"), [(None, True), (1 << 40, True), (1 << 20, False)])
def test_geometry_is_let_go_of_where_a_bake_does_not_fit_beside_it(room, kept, tmp_path, available_memory):
    (tmp_path / "s.toml").write_text('[[objects]]\nbuiltin = "sphere"\n[render]\nwidth = 8\nheight = 8\n')
    description = read_scene(tmp_path / "s.toml")
    available_memory(room, "obscurance.scenes.description.obscurance")
    baked, _ = with_obscurance(description)
    assert (description.scene in render_scene._scenes) == kept
    assert baked.objects[0].w is not None


def test_points_that_do_not_fit_are_refused_once_they_are_counted(available_memory):
    """Loose triangles have six times the points of a closed surface."""
    corners = np.random.default_rng(0).uniform(size=(9000, 3))
    room = iter([1 << 40, MIB])
    available_memory(lambda: next(room))
    with pytest.raises(MemoryLimitError, match=r"at most 1 MiB.* to trace rays at 9,000 points"):
        ao.bake(Mesh(corners, np.arange(9000).reshape(-1, 3)), samples=1)


PEAK = """
import re
from obscurance import cli
try:
    cli.main()
finally:
    print("peak", re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1])
"""


@LINUX
@pytest.mark.slow
@pytest.mark.parametrize(
    ("ending", "target", "options"),
    [
        ("ply", "w.npz", ("--samples", "8")),
        ("stl", "w.npz", ("--samples", "8")),
        ("ply", "w.npz", ("--tolerance", "0.02")),
        ("obj", "w.png", ("--tolerance", "0.01", "--size", "1500")),
        ("obj", "w.png", ("--samples", "8", "--size", "1000")),
    ],
)
def test_a_dry_run_says_what_a_bake_takes(ending, target, options, tmp_path):
    vertices, faces = hills({"ply": 390, "stl": 230, "obj": 60}[ending])
    mesh = tmp_path / f"hills.{ending}"

    def low():
        """The hills a tenth as high, with texture coordinates."""
        rows = [f"v {x} {y} {z / 10}\nvt {x / 2 + 0.5} {y / 2 + 0.5}" for x, y, z in vertices]
        rows += ["f " + " ".join(f"{corner}/{corner}" for corner in face) for face in faces + 1]
        return "\n".join([*rows, ""]).encode()

    contents = {"ply": lambda: ply(vertices, faces), "stl": lambda: stl(vertices[faces]), "obj": low}
    mesh.write_bytes(contents[ending]())

    def output(*more):
        command = [sys.executable, "-c", PEAK, "bake", mesh, "-o", tmp_path / target, *options, *more]
        return subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT).stdout

    said = int(re.search(r"about (\d+) MiB in all", output("--dry-run"))[1])
    runs = [output("--quiet") for _ in range(2)]  # the first may compile
    taken = min(int(run.split("peak")[1]) / 1024 for run in runs)
    assert 1 / 1.2 < said / taken < 1.2


SMALL = "from obscurance.raytrace.system import checks; checks.available_memory = lambda: 160 << 20; "
SMALL += "from obscurance import cli; cli.main()"


def test_the_command_refuses_with_one_line(tmp_path):
    mesh, target = tmp_path / "hills.ply", tmp_path / "w.npy"
    vertices, faces = hills(330)
    mesh.write_bytes(ply(vertices, faces))

    def bake(*options):
        command = [sys.executable, "-c", SMALL, "bake", mesh, "-o", target, "--samples", "8", "--quiet", *options]
        return subprocess.run(command, capture_output=True, text=True, check=False, timeout=300, cwd=ROOT)

    assert bake().returncode == 0
    assert len(np.load(target)) == len(vertices)
    target.unlink()
    result = bake("--method", "surface")
    assert (result.returncode, result.stdout) == (2, "")
    assert re.fullmatch(
        r"obscurance: .*hills.ply: memory: expected at most 160 MiB, what is available, got about 2\d\d MiB to bake"
        r" 108,900 vertices and 216,482 faces by the surface method; the vertex method takes about \d\d MiB",
        result.stderr.splitlines()[-1],
    )
    assert "Traceback" not in result.stderr
    assert not target.exists()
