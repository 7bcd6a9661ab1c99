"""Links and pictures of the pages lead to files and headings that are there; the site's contents list every page."""

import re
from collections import Counter

import pytest
from project import ROOT

DOCS = ROOT / "docs"
EVIDENCE = ROOT / "benchmarks" / "evidence"
BESIDE = [ROOT / "README.md", ROOT / "CHANGELOG.md", ROOT / "CONTRIBUTING.md", *sorted(EVIDENCE.glob("*.md"))]
PAGES = [*BESIDE, *sorted(DOCS.rglob("*.md"))]
CODE = re.compile(r"^(`{3,}).*?^\1`*$|`[^`\n]*`", re.DOTALL | re.MULTILINE)


def links(text):
    """What Markdown outside of code links to or shows: paths, anchors and addresses."""
    prose = CODE.sub("", text)
    inline = re.findall(r"\]\(\s*<?([^)\s>]+)", prose)
    return inline + re.findall(r"^\[[^\]]+\]:\s*(\S+)", prose, re.MULTILINE) + re.findall(r'src="([^"]+)"', prose)


def anchors(text):
    """The anchors that Git forges and the site give a page's headings."""
    seen, found = Counter(), set()
    for heading in re.findall(
        r"^#{1,6} (.+?)\s*$", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE), re.M
    ):
        shown = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).lower()
        slug = re.sub(r"[^\w\- ]", "", shown).replace(" ", "-")
        found.add(f"{slug}-{seen[slug]}" if seen[slug] else slug)
        seen[slug] += 1
    return found


def broken(page, text):
    """Links of a page, in words, that lead nowhere."""
    for link in links(text):
        path, _, anchor = link.partition("#")
        if re.match(r"[a-z]+:", link):
            continue
        target = (page.parent / path).resolve() if path else page
        if target != page and not target.is_file():  # folders have no page in the site
            yield f"{link}: no such file"
        elif anchor and anchor not in anchors(text if target == page else target.read_text()):
            yield f"{link}: no such heading"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_link_leads_somewhere(page):
    assert list(broken(page, page.read_text(encoding="utf-8"))) == []


def test_every_page_is_in_the_contents_of_the_site():
    listed = []
    for contents in re.findall(
        r"^```\{toctree\}\n(.*?)^```", (DOCS / "index.md").read_text(), re.DOTALL | re.MULTILINE
    ):
        for line in contents.splitlines():
            name = re.sub(r".*<(.+)>", r"\1", line)
            if name and not name.startswith(":"):
                listed += (
                    [name] if "*" not in name else [str(p.relative_to(DOCS))[:-3] for p in DOCS.glob(f"{name}.md")]
                )
    pages = {path.relative_to(DOCS).with_suffix("").as_posix() for path in DOCS.rglob("*.md")} - {"index"}
    assert pages - set(listed) == set(), "not in a toctree of docs/index.md"
    assert set(listed) - pages == set(), "in docs/index.md, but there is no such page"
