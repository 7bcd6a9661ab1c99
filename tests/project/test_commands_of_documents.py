"""The commands in the documents, on small meshes, need no kernel that the library has not."""

import re
import shlex
import shutil

import pytest
import trimesh
from command import obscurance, succeeded
from mesh_files import obj, ply
from meshes import hills
from PIL import Image
from project import ROOT, hide_compiler

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
PAGES.remove(ROOT / "docs" / "gallery.md")  # test_docs_pictures.py runs its commands
BLOCK = re.compile(r"```sh\n(.*?)```", re.DOTALL)
COMMAND = re.compile(r"^(?:\.venv/bin/)?obscurance (.*)$", re.MULTILINE)
ELSEWHERE = ("--cluster",)  # needs other processes
INPUTS = ("chair", "table", "props/a", "scan", "m", "teapot", "duck", "robot", "shelf", "low", "body", "bolts", "cage")
RENDER = ("--width", "24", "--height", "24", "--samples", "4")
TEXTURES = (".png", ".exr", "texture", "godot", "unreal")  # as words end


def commands():
    """The words of every command that this process can run, without --open."""
    text = "".join(block for page in PAGES for block in BLOCK.findall(page.read_text()))
    lines = [shlex.split(line, comments=True) for line in COMMAND.findall(text)]
    return [[word for word in line if word != "--open"] for line in lines if not set(ELSEWHERE) & set(line)]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """The current folder, with a mesh by every name that the documents have, with texture coordinates."""
    vertices, faces = hills(6)
    uv = (vertices[:, :2] - vertices[:, :2].min(0)) / (1.1 * (vertices[:, :2].max(0) - vertices[:, :2].min(0)))
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.new("RGB", (4, 4)), name="skin")
    shape = trimesh.Trimesh(vertices, faces, visual=trimesh.visual.TextureVisuals(uv, material=material), process=False)
    corners = [" ".join(f"{k + 1}/{k + 1}" for k in face) for face in faces]
    textured = obj(vertices, []) + "\n".join([*(f"vt {u} {v}" for u, v in uv), *(f"f {c}" for c in corners)]).encode()
    for name in INPUTS:
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / f"{name}.glb").write_bytes(shape.export(file_type="glb"))
        (tmp_path / f"{name}.obj").write_bytes(textured)
        (tmp_path / f"{name}.ply").write_bytes(ply(vertices, faces))
    (tmp_path / "demo").mkdir()
    (tmp_path / "sponge.ply").write_bytes(ply(vertices, faces))
    shutil.copy(ROOT / "scenes" / "library" / "still_life.toml", tmp_path / "ball.toml")
    monkeypatch.chdir(tmp_path)
    succeeded("bake", "m.obj", "-o", "demo/temple.ply", "--samples", 16)
    return tmp_path


def small(line):
    """The words of a command that takes less time: fewer rays, pixels and texels; the later of two options counts."""
    if line[0] == "render":
        return [*line, *RENDER]
    if line[0] != "bake":
        return line
    rays = [] if "--tolerance" in line else ["--samples", "4"]
    size = ["--size", "64"] if any(word.endswith(TEXTURES) for word in line) else []
    return [*line, *rays, *size]


def test_the_commands_need_no_compiler(folder, monkeypatch):
    lines = commands()
    hide_compiler(monkeypatch)
    done = [obscurance(*small(line)).returncode for line in lines if line[0] != "demo"]  # the folder has what it makes
    assert done.count(0) > 50, list(zip(lines, done, strict=False))
