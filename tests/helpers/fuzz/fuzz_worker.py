"""Gives damaged files to the loaders, one after the other, in a process that may not take much time or memory.

    python tests/helpers/fuzz/fuzz_worker.py SEED FIRST END PROGRESS  the inputs FIRST … END - 1, as `fuzzing.run` does
    python tests/helpers/fuzz/fuzz_worker.py SEED INDEX               one input: keeps its file and reports what happens

A seed is any text; with one that begins with "commands", the files go through every command that reads them, else
through the loaders. Findings are JSON lines on standard output.
"""

import faulthandler
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from contextlib import contextmanager, suppress
from pathlib import Path

import fuzz_commands
import fuzz_mutations
import fuzz_seeds
from fuzz_commands import Finding
from fuzz_sandbox import memory, modest, prepared, reset_peak, silent, watch

SECONDS = 10  # of processor time for one input
COMMAND_SECONDS = 20  # for one command: a scene of 28,000 instances takes some 9, while others run 14
SPARE = 2 << 30  # address space beyond what the process has once it is warm
CONSTANT, FACTOR = 64 << 20, 256  # an input of k bytes may take CONSTANT + FACTOR k bytes
PICTURES = ("png", "jpeg", "exr", "tiff", "pictures")
OUT_OF_MEMORY = "sizes that fit into memory"
MOST = 1 << 30  # bytes that a command may take


def by_commands(seed):
    return seed.startswith("commands")


def input_of(seed, index):
    """The family of an input, its name and content, and the chance that is left."""
    maker = fuzz_commands if by_commands(seed) else fuzz_mutations
    families = fuzz_commands.FAMILIES if by_commands(seed) else list(fuzz_seeds.seeds())
    family, chance = families[index % len(families)], random.Random(f"{seed}:{index}")
    return family, *maker.spoiled(family, chance), chance


def consume(family, path, made, index):
    """Do with the file what the commands do."""
    if family in PICTURES:
        return look(path)
    from obscurance import ao
    from obscurance.raytrace.errors import OptionError
    from obscurance.scenes.commands.info import describe
    from obscurance.scenes.description.obscurance import with_obscurance
    from obscurance.scenes.description.read import read_scene
    from obscurance.scenes.formats.load import load
    from obscurance.scenes.formats.unsupported import unsupported_features
    from obscurance.scenes.formats.write import write

    if family == "array":
        scene = path.with_name("m.toml")
        scene.write_text(fuzz_mutations.toml_text(fuzz_seeds.BAKED | {"obscurance": {"baked": path.name}}))
        with_obscurance(read_scene(scene, (4, 3)))
        return None
    if family == "mtl":
        return textures(read_scene(path.with_name("square.obj"), (8, 6)))
    if family == "toml":
        return textures(read_scene(path, (8, 6)))
    target = made / f"made.{('ply', 'glb')[index % 2]}"
    file = load(path, target)
    with suppress(OptionError):  # coordinates beyond float32
        unsupported_features(target, file)
    rows = describe(file)
    for name, text in rows:
        if not (name.isprintable() and text.isprintable()):
            raise Finding(f"info prints {text!r}")
        text.encode()
    textures(read_scene(path, (8, 6)))
    if index % 5 == 0 and len(file.mesh.faces) < 5000:
        baked = ao.bake(file.mesh, samples=4, threads=1)
        if not ((baked.w >= 0) & (baked.w <= 1)).all():
            raise Finding("w is not in [0, 1]")
        write(made / "made.npz", baked, file)
        write(made / "made.ply", baked, file, colors="rgb")
        load(made / "made.ply")
        with suppress(OptionError):  # coordinates beyond float32
            write(made / "made.glb", baked, file, colors="rgb")
            load(made / "made.glb")
            write(made / "ramp.glb", baked, file, replace_occlusion=True)
            describe(load(made / "ramp.glb"))


def textures(description):
    from obscurance.raytrace.image.texture import pack_textures
    from obscurance.raytrace.renderer.geometry import shape_textures

    pack_textures(shape_textures(item.shape for item in description.scene.objects))


def look(path):
    from obscurance.raytrace.image.compare import compare
    from obscurance.raytrace.image.read import read_image
    from obscurance.raytrace.image.texture import Texture, pack_textures

    refused = []
    for step in (lambda: read_image(path), lambda: compare(path, path), lambda: pack_textures([Texture(path)])):
        try:
            step()
        except ValueError as reason:
            refused.append(reason)
    if refused:
        raise refused[0]


def checked(family, path, made, index, opened, target=None):
    """Whether the input was accepted; its message if it was refused. Raises: Finding."""
    from obscurance.raytrace.errors import LINE, InputError

    reset_peak()
    before, start = memory(), time.process_time()
    message = None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            (target or consume)(family, path, made, index)
    except InputError as refusal:
        message = str(refusal)
        if not message.isprintable():
            raise Finding(f"not one printable line: {message!r}") from None
        if OUT_OF_MEMORY in message:
            raise Finding("memory was asked for before the sizes were checked: " + where(refusal)) from None
        if len(message) > LINE:
            raise Finding(f"a message of {len(message)} characters: {message[:300]}") from None
        if not message.startswith(str(path.parent)):
            raise Finding(f"the message names no file: {message}") from None
    except Finding:
        raise
    except BaseException as other:
        raise Finding(f"{type(other).__name__}: {other}; {where(other)}") from None
    size = path.stat().st_size
    peak = memory("VmHWM") - before
    if peak > CONSTANT + FACTOR * size:
        raise Finding(f"{peak >> 20} MiB for {size} bytes")
    if opened:
        seen = sorted(set(opened))
        opened.clear()
        raise Finding(f"opened {seen}")
    return message, peak, time.process_time() - start


def commanded(family, path, made, chance, opened):
    """As `checked`, for all commands that read the file: accepted if one made a bake or a picture."""
    first, accepted, highest, longest = None, False, 0, 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for arguments, target in fuzz_commands.commands(family, path, made, chance):
            size = path.stat().st_size >> 20  # a file of many megabytes may take its time
            signal.setitimer(signal.ITIMER_PROF, COMMAND_SECONDS + size)
            reset_peak()
            before = memory()
            message, seconds = fuzz_commands.checked_command(arguments, target, made)
            peak = memory("VmHWM") - before
            if peak > MOST:
                raise Finding(f"{arguments[0]}: {peak >> 20} MiB")
            if message and OUT_OF_MEMORY in message:
                raise Finding(f"{arguments[0]}: memory was asked for before the sizes were checked: {message}")
            if opened:
                seen = sorted(set(opened))
                opened.clear()
                raise Finding(f"{arguments[0]}: opened {seen}")
            accepted |= message is None and arguments[0] in ("bake", "render", "falloff")
            first, highest, longest = first or message, max(highest, peak), max(longest, seconds)
    return None if accepted else first, highest, longest


def where(error):
    chain = [error.__context__] if error.__context__ else []
    frames = [frame for each in (error, *chain) for frame in traceback.extract_tb(each.__traceback__)]
    return " < ".join(f"{Path(frame.filename).name}:{frame.lineno} {frame.name}" for frame in reversed(frames[-8:]))


def main(seed, first, end, progress):
    kept = progress is None
    results = os.fdopen(os.dup(1), "w")
    folder = Path(tempfile.mkdtemp(prefix="fuzz-")).resolve()
    fuzz_seeds.seeds()
    inside, commands = prepared(folder), by_commands(seed)
    modest(*((1_500_000, 500_000) if commands else (20_000, 200_000)))
    warm(inside, folder / "made", commands)
    opened = watch(folder)
    tempfile.tempdir = str(folder / "made")
    limit = memory("VmSize") + (MOST if commands else SPARE)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    crash = os.dup(2)
    faulthandler.register(signal.SIGPROF, file=crash, chain=True)
    printed = os.open(folder / "made" / "printed", os.O_RDWR | os.O_CREAT)
    if not kept:
        os.dup2(printed, 1)
        os.dup2(printed, 2)
        faulthandler.enable(crash)
    for index in range(first, end):
        family, name, content, chance = input_of(seed, index)
        if progress:
            os.pwrite(progress, f"{index:<12}".encode(), 0)
        path = inside / name
        with in_place(path, content):
            signal.setitimer(signal.ITIMER_PROF, SECONDS)
            try:
                if commands:
                    message, peak, seconds = commanded(family, path, folder / "made", chance, opened)
                else:
                    message, peak, seconds = checked(family, path, folder / "made", index, opened)
                said = "" if kept else silent(printed)
                if said:
                    raise Finding(f"printed {said!r}")
                outcome = "refused" if message else "accepted"
                if kept:
                    print(f"{outcome}: {message}; {peak >> 10} KiB, {seconds:.3f} s")
                results.write(json.dumps([family, outcome, peak, seconds]) + "\n")
            except Finding as finding:
                if not kept:
                    silent(printed)
                results.write(json.dumps({"index": index, "family": family, "finding": str(finding)}) + "\n")
            signal.setitimer(signal.ITIMER_PROF, 0)
            results.flush()
            if kept:
                shutil.copy(path, f"input-{index}{path.suffix}")
    results.close()
    shutil.rmtree(folder)


@contextmanager
def in_place(path, content):
    """A file with this content, be it in place of a sound one."""
    spared = path.read_bytes() if path.exists() else None
    path.write_bytes(content)
    try:
        yield
    finally:
        path.unlink()
        if spared is not None:
            path.write_bytes(spared)


def warm(inside, made, commands=False):
    """Everything imported and compiled, all threads started."""
    chance = random.Random(0)
    for family, name, content in (fuzz_commands if commands else fuzz_mutations).unspoiled():
        with in_place(inside / name, content):
            if not commands:
                consume(family, inside / name, made, 0)
                continue
            for _ in range(4):
                for arguments, target in fuzz_commands.commands(family, inside / name, made, chance):
                    fuzz_commands.checked_command(arguments, target, made)


if __name__ == "__main__":
    if len(sys.argv) == 3:
        main(sys.argv[1], int(sys.argv[2]), int(sys.argv[2]) + 1, None)
    else:
        main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), os.open(sys.argv[4], os.O_WRONLY | os.O_CREAT))
