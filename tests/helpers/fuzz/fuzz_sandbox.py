"""The process of a fuzzing worker: folders, files that are opened, memory, and what libraries print."""

import os
import sys
from pathlib import Path

import fuzz_commands
import fuzz_seeds
from project import ROOT


def prepared(folder):
    """The folder of the inputs, what they may refer to within it, and what they must not reach beside it."""
    inside = folder / "inside"
    for name, content in fuzz_commands.companions().items():
        target = inside / name
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
    (folder / "secret.bin").write_bytes(fuzz_seeds.gltf()[1])
    (folder / "secret.png").write_bytes(fuzz_seeds.image("png"))
    (inside / "link.bin").symlink_to(folder / "secret.bin")
    (inside / "out").symlink_to(folder, target_is_directory=True)
    os.mkfifo(inside / "pipe")
    (folder / "made").mkdir()
    return inside


def watch(folder):
    """Note every file that Python opens outside of the folder, but for modules and what is written on purpose."""
    opened = []
    proc = [
        "/proc/self",
        "/proc/meminfo",
        "/proc/cpuinfo",
        str(Path("<unknown>").resolve()),
    ]  # linecache looks for kernels
    system = [sys.prefix, sys.base_prefix, "/usr", "/lib", "/etc/ld", *proc, "/dev/null", "/sys"]
    allowed = tuple(map(os.path.realpath, [folder / "inside", folder / "made", ROOT, *system]))

    def hook(event, arguments):
        if event == "open" and isinstance(arguments[0], str | bytes):
            path = os.path.realpath(os.fsdecode(arguments[0]))
            if not path.startswith(allowed):
                opened.append(path)
        elif event in ("socket.connect", "subprocess.Popen", "os.system"):
            opened.append(event)

    sys.addaudithook(hook)
    return opened


def reset_peak():
    with open("/proc/self/clear_refs", "w") as file:
        file.write("5")


def memory(field="VmRSS"):
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) << 10 for line in file if line.startswith(field + ":"))


def silent(stream):
    """What a library has printed by itself since the last call."""
    sys.stdout.flush()
    sys.stderr.flush()
    text = os.pread(stream, 500, 0)
    os.ftruncate(stream, 0)
    os.lseek(stream, 0, os.SEEK_SET)
    return text.decode("utf-8", "replace")


def modest(triangles, rows):
    """Built-in shapes and copies are work that a few bytes may ask for on purpose: here no more than a little.

    Nor are control groups asked, a dozen files each time: the process's own limits are lower.
    """
    import obscurance.raytrace.system.checks
    import obscurance.scenes.geometry.builtin_shapes
    import obscurance.scenes.geometry.instances

    obscurance.scenes.geometry.builtin_shapes.MAX_TRIANGLES = triangles
    obscurance.scenes.geometry.instances.MAX_COPIED = rows
    obscurance.raytrace.system.checks._control_groups = lambda root: ()
