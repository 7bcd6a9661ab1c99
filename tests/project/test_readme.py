"""The README and the docs: examples work, files that they name exist."""

import re
import shlex
import shutil

import numpy as np
from command import succeeded
from project import ROOT

README = (ROOT / "README.md").read_text()


def test_the_python_examples_run_one_after_the_other(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {}
    for code in re.findall(r"```python\n(.*?)```", README, re.DOTALL):
        exec(compile(code, "README.md", "exec"), names)
    assert "[" in capsys.readouterr().out
    assert (tmp_path / "temple.glb").stat().st_size > 1000


def test_the_commands_run_one_after_the_other(tmp_path, monkeypatch, demonstration):
    monkeypatch.chdir(tmp_path)
    makefile = (ROOT / "Makefile").read_text()
    made = set()
    for line in "".join(re.findall(r"```sh\n(.*?)```", README, re.DOTALL)).splitlines():
        words = shlex.split(line, comments=True)
        if words[0] == "make":
            (recipe,) = re.findall(rf"^{words[1]}:.*\n\t\$\(BIN\)/(.*)$", makefile, re.MULTILINE)
            words = recipe.split()
        assert words[0].removeprefix(".venv/bin/") == "obscurance"
        if words[1:] == ["demo", "--output", "demo"]:
            shutil.copytree(demonstration, "demo")
        else:
            small = {"render": ["--width", 96, "--height", 64], "bake": ["--tolerance", 0.05]}
            succeeded(*words[1:], *small.get(words[1], []))
        assert {path for path in tmp_path.rglob("*") if path.is_file()} > made, f"{line} writes nothing"
        made = {path for path in tmp_path.rglob("*") if path.is_file()}
    assert {path.name for path in made} >= {"temple.ply", "temple.png", "temple.html", "temple.glb", "still_life.exr"}


def test_the_readme_is_short_and_has_a_screen_to_begin_with():
    assert len(README.split()) <= 700
    first = README[: README.index("\n## ")]
    assert len(first.splitlines()) <= 40
    assert "make demo" in first


def test_the_examples_of_the_page_about_normals():
    page = (ROOT / "docs" / "normals.md").read_text()
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    names = {}
    exec(compile(code, "normals.md", "exec"), names)
    shown = re.findall(r"^(\w+\(.*\))  # [^\[]*(\[.*\])$", code, re.MULTILINE)
    assert len(shown) == 3
    for call, result in shown:
        np.testing.assert_allclose(eval(call, names), eval(result), atol=1e-9)
    from obscurance import raytrace

    for function in re.findall(r"^\| `(\w+)\(", page, re.MULTILINE):
        assert function in raytrace.__all__


def test_every_command_of_the_readme_exists():
    from obscurance import cli

    known = set(cli.commands.commands)
    named = set(re.findall(r"(?:bin/|`)obscurance ([a-z]+)", README))
    assert named == known


def test_the_layout_names_every_folder_and_only_files_that_exist():
    page = (ROOT / "docs" / "architecture.md").read_text()
    table = page[page.index("## Layout") : page.index("## Bake pipeline")]
    package, named = None, set()
    for row in re.findall(r"^\| (`.*) \| (.*) \|$", table, re.MULTILINE):
        folders = re.findall(r"`([\w.]+)/?`", row[0])
        package = folders[0] if folders[0] in ("raytrace", "ao", "scenes") else package
        within = [folder for folder in folders if package and (ROOT / package / folder).is_dir()]
        named |= {(package, folder) for folder in within}
        for folder in folders if not within else []:
            assert (ROOT / folder).exists(), folder
        places = [ROOT / package / folder for folder in within] or [ROOT / folders[0]]
        for file in re.findall(r"`([\w/]+\.py)`", row[1]):
            assert any((place / file).exists() for place in [*places, ROOT]), file
    held = {
        (top, path.name) for top in ("raytrace", "ao", "scenes") for path in (ROOT / top).iterdir() if path.is_dir()
    }
    assert {each for each in held if each[1] != "__pycache__"} == named
