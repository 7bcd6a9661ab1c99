"""Pictures that cannot be written: what is said, and what is left as it was."""

import json
import os
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from pictures import ENDINGS, METADATA, frame, names, plain, python

from obscurance.raytrace.errors import OptionError, OutputError
from obscurance.raytrace.image.write import check_image_target

FULL_DISK = """
import json, resource, sys
from pictures import METADATA, frame
from obscurance.raytrace.image import write
reserve = write._reserve
unlimited = resource.getrlimit(resource.RLIMIT_FSIZE)
outcomes = []
for target, reserved, limit in json.loads(sys.argv[1]):
    write._reserve = reserve if reserved else lambda *_: None
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, unlimited[1]))
    try:
        frame().save(target, METADATA)
        outcomes.append("")
    except OSError as reason:
        outcomes.append(f"{type(reason).__name__} {reason}")
    resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)
print(json.dumps(outcomes))
"""


@pytest.mark.skipif(os.name == "nt", reason="POSIX limits")
def test_a_full_disk_is_one_line_and_leaves_the_old_file(tmp_path):
    """A limit on file sizes stands for the full disk. It is noticed even if the room ran out after it was reserved."""
    cases = []
    for ending, reserve in [*((ending, True) for ending in ENDINGS), (".png", False), (".tif", False)]:
        for share in (0.0, 0.5, 0.999):
            folder = tmp_path / str(len(cases))
            folder.mkdir()
            target = folder / f"a{ending}"
            frame().save(target, METADATA)
            cases.append((str(target), reserve, int(share * target.stat().st_size)))
            target.write_bytes(b"before")
    run = python(FULL_DISK, json.dumps(cases))
    assert run.stderr == ""
    for (name, *case), message in zip(cases, json.loads(run.stdout), strict=True):
        target = Path(name)
        assert message.startswith(f"OutputError {target}: cannot write: "), case
        assert len(message.splitlines()) == 1, case
        assert target.read_bytes() == b"before", case
        assert names(target.parent) == [target.name], case


@pytest.mark.skipif(os.name == "nt", reason="POSIX limits")
def test_a_full_disk_is_named(tmp_path, monkeypatch):
    import resource

    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=0))
    unlimited = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, unlimited[1]))
    try:
        with pytest.raises(OutputError, match=r"a\.exr: cannot write: No space left on device"):
            frame().save(tmp_path / "a.exr")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, unlimited)


@pytest.mark.parametrize("ending", ENDINGS)
def test_an_interrupt_leaves_the_old_file(tmp_path, ending):
    class Interrupted(np.ndarray):
        """Numbers of which no rows can be written: Ctrl-C comes when the file beside the target is there."""

        def __getitem__(self, key):
            if isinstance(key, slice):
                assert len(names(tmp_path)) == 2
                raise KeyboardInterrupt
            return super().__getitem__(key)

    target = tmp_path / f"a{ending}"
    target.write_bytes(b"before")
    picture = frame()
    picture.layers["beauty"] = picture.layers["beauty"].view(Interrupted)
    with pytest.raises(KeyboardInterrupt):
        picture.save(target)
    assert target.read_bytes() == b"before"
    assert names(tmp_path) == [target.name]


@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("a.gif", {}, r"output: expected a name ending in \.exr .*, got .*a\.gif"),
        ("a", {}, "output: expected a name ending"),
        ("a.png", {"half": True}, r"half: expected an output that ends in \.exr"),
        ("a.exr", {"layers": ["beauty", "colour"]}, "layers: expected names out of .*, got colour"),
        ("a.exr", {"layers": []}, "layers: expected at least one layer, each once, got none"),
        ("a.exr", {"layers": ["depth", "depth"]}, "layers: expected at least one layer, each once"),
        ("a.png", {"layers": ["depth"]}, r"layers: expected one layer of colours in a \.png file.*, got depth"),
        ("a.jpg", {"layers": ["beauty", "albedo"]}, "layers: expected one layer"),
    ],
)
def test_what_cannot_be_written_is_outcomes_before_the_work(tmp_path, name, options, message):
    with pytest.raises(OptionError, match=message) as early:
        check_image_target(tmp_path / name, **options)
    with pytest.raises(OptionError) as late:
        frame().save(tmp_path / name, **options)
    assert str(early.value) == str(late.value)
    assert "\n" not in str(early.value)
    assert names(tmp_path) == []


def test_a_layer_that_the_frame_lacks(tmp_path):
    with pytest.raises(OptionError, match="expected layers of the frame: beauty, got depth"):
        plain((0, 0, 0, 1)).save(tmp_path / "a.exr", layers=["depth"])
