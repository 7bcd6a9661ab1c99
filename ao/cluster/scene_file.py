"""What rays are traced in as a file that workers load, named by its content: faces of a bake, or a picture.

A file and not data that the scheduler holds: what is scattered to workers is lost with them (distributed #3149, #5704).
It is a pickle, with arrays behind it that are neither copied to be written nor to be read; a worker loads it once its
hash is the one that came with the work, from whom could as well send any function to be called.
"""

import hashlib
import pickle
import struct
from pathlib import Path
from typing import Any, NamedTuple

from raytrace.system.atomic import atomic_write

_SIZE = struct.Struct("<q")


class SceneFile(NamedTuple):
    """Attributes: path: absolute. digest: hash of what is in it, 64 hex digits."""

    path: str
    digest: str


def write_scene(folder: Path, name: str, scene: object) -> SceneFile:
    """Write a scene into `folder`, if it is not there yet.

    Args: name: of one bake, which removes the file in the end: another of the same mesh may still need its own.

    Raises:
        OutputError: the file cannot be written.
    """
    arrays: list[pickle.PickleBuffer] = []
    head = pickle.dumps(scene, protocol=5, buffer_callback=arrays.append)
    parts = [memoryview(head), *(array.raw() for array in arrays)]
    digest = hashlib.blake2b(digest_size=32)
    for part in parts:
        digest.update(_SIZE.pack(part.nbytes))
        digest.update(part)
    path = folder.absolute() / f".{name}-{digest.hexdigest()[:32]}.scene"
    if not path.exists():
        with atomic_write(path) as file:
            for part in parts:
                file.write(_SIZE.pack(part.nbytes))
                file.write(part)
    return SceneFile(str(path), digest.hexdigest())


def load_scene(file: SceneFile) -> Any:
    """The scene that was written.

    Raises:
        OSError: there is no such file here, or it cannot be read.
        ValueError: it holds something else.
    """
    parts: list[bytearray] = []
    digest = hashlib.blake2b(digest_size=32)
    with Path(file.path).open("rb") as stored:
        left = stored.seek(0, 2)
        stored.seek(0)
        while left >= _SIZE.size:
            size = stored.read(_SIZE.size)
            digest.update(size)
            left -= _SIZE.size
            part = bytearray(max(min(_SIZE.unpack(size)[0], left), 0))
            left -= stored.readinto(part)
            digest.update(part)
            parts.append(part)
    if digest.hexdigest() != file.digest:
        raise ValueError("other content than its name says")
    return pickle.loads(parts[0], buffers=parts[1:])
