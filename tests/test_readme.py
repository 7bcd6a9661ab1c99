"""What the README shows works."""

import re
from pathlib import Path

README = (Path(__file__).resolve().parent.parent / "README.md").read_text()


def test_the_python_example_runs(capsys):
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    exec(compile(code, "README.md", "exec"), {})
    assert "[" in capsys.readouterr().out


def test_every_command_of_the_readme_exists():
    from typer.main import get_command

    import cli

    known = set(get_command(cli.app).commands)
    named = set(re.findall(r"(?:bin/|`)obscurance ([a-z]+)", README))
    assert named == known


def test_every_file_that_the_readme_links_to_exists():
    root = Path(__file__).resolve().parent.parent
    for target in re.findall(r"\]\(([^)]+)\)", README):
        assert (root / target).exists(), target
