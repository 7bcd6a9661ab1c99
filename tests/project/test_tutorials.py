"""The tutorials run from top to bottom, and what they show is what comes out."""

import re

import pytest
from command import succeeded

from benchmarks.pictures.tutorials import PAGES, cells, run_page
from obscurance.raytrace.image.compare import compare

NUMBER = re.compile(r"[+-]?\b\d[\d,]*(?:\.\d+)?")
ALLOWED = 0.003  # mean FLIP, as of all pictures of the documentation


def command(*arguments):
    return succeeded(*arguments).stdout


def values(text):
    return [float(number.replace(",", "")) for number in NUMBER.findall(text)]


def agrees(printed, shown):
    """Whether two texts are alike but for their last digits, which another processor may make others."""
    same = NUMBER.sub("#", printed).split() == NUMBER.sub("#", shown).split()
    return same and values(printed) == pytest.approx(values(shown), rel=0.1, abs=0.011)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_tutorial_shows_what_comes_out(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for printed, shown, image, picture in run_page(page, command):
        assert agrees(printed, shown or ""), f"{page.name} shows\n{shown}\nbut this comes out:\n{printed}"
        if picture or image:
            (tmp_path / "made.png").write_bytes(image)
            assert compare(page.parent / picture, tmp_path / "made.png").flip <= ALLOWED


def test_tutorials_have_code_commands_outputs_and_pictures():
    assert [page.stem for page in PAGES] == ["first_bake", "scene", "validation"]
    found = [cell for page in PAGES for cell in cells(page)]
    assert {language for language, *_ in found} == {"python", "sh"}
    assert sum(text is not None for _, _, text, _ in found) >= 10
    assert sum(picture is not None for *_, picture in found) == 3
