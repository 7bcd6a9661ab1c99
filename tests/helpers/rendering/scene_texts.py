"""A folder with a scene and what it refers to, for the tests."""

from obscurance.scenes.description.read import read_scene

SQUARE = """\
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
vt .5 .5
vn 0 0 1
f 1/1/1 2/2/1 3/3/1
f 1/5/1 3/3/1 4/4/1
"""
PLAIN = '[[objects]]\nbuiltin = "plane"\nfineness = 0.5\n'


def written(folder, text, **files):
    """The path of a TOML text, in a folder with `square.obj`, `paint.png` and more files."""
    folder.mkdir(exist_ok=True)
    contents = {"square.obj": SQUARE, "paint.png": "any content: it is read when a ray has seen it", "scene.toml": text}
    for name, content in {**contents, **files}.items():
        target = folder / name
        target.parent.mkdir(exist_ok=True, parents=True)
        target.write_bytes(content if isinstance(content, bytes) else content.encode())
    return folder / "scene.toml"


def scene(folder, text, **files):
    """The scene that is `written`."""
    return read_scene(written(folder, text, **files))
