"""The documents stay short enough to be read."""

import re

from project import ROOT

DOCS = ROOT / "docs"
ABOUT = ("architecture", "changelog", "contributing", "glossary", "index", "method", "references")
"""Pages of docs/ for those who change the program."""
GUIDES = (
    "bake", "batches", "checking", "cluster", "coming_from", "installation", "profile", "programs", "python",
    "rendering", "scenes", "surface", "textures", "viewing",
)  # fmt: skip
MOST = {"guides": 26_400, "evidence": 12_000, "changelog": 2_250}


def words(*pages):
    return sum(len(page.read_text(encoding="utf-8").split()) for page in pages)


def test_guides_evidence_and_changelog_have_at_most_so_many_words():
    guides = [page for page in DOCS.rglob("*.md") if page.relative_to(DOCS).with_suffix("").as_posix() not in ABOUT]
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    unreleased = re.split(r"^## ", changelog, flags=re.MULTILINE)[1]
    assert words(ROOT / "README.md", *guides) <= MOST["guides"]
    assert words(*(ROOT / "benchmarks" / "evidence").glob("*.md")) <= MOST["evidence"]
    assert len(unreleased.split()) <= MOST["changelog"]


def test_guides_begin_with_what_a_reader_wants():
    for name in GUIDES:
        head = (DOCS / f"{name}.md").read_text(encoding="utf-8").split("\n## ")[0]
        assert re.search(r"\bI (?:want|know)\b", head), name
