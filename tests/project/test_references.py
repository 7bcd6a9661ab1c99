"""Whatever is cited stands in docs/references.md in full."""

import re

from project import ROOT

PAGE = ROOT / "docs" / "references.md"
PLACES = ("raytrace", "ao", "scenes", "benchmarks", "docs", "tests")
NAME = r"(?:van )?[A-ZÅÖÜ][^\W\d_]+(?:[’'-][A-Z][^\W\d_]+)*"
YEAR = r"(?:1[6-9]|20)\d\d\b(?! ?[×x]|[,.]\d)"
CITED = re.compile(rf"({NAME}(?:, {NAME})*(?:,? (?:&|and) {NAME})?(?: et al\.)?) \(?({YEAR})")
TITLED = re.compile(r'\b(?:19|20)\d\d, "([^"]+)"|"([^"]+)", (?:SIGGRAPH|IEEE|ACM|CACM)')
NO_AUTHORS = {"SIGGRAPH"}


def citations(text):
    """Authors and year of each "Name & Name 1990", and the titles that are quoted with a year or place."""
    text = re.sub(r"\s*\n\s*(?:# )?", " ", text)
    cited = {(tuple(re.findall(NAME, names)), year) for names, year in CITED.findall(text)}
    titles = {(first or second).rstrip(",.") for first, second in TITLED.findall(text)}
    return {(names, year) for names, year in cited if not NO_AUTHORS & set(names)}, titles


def entries(text):
    return [" ".join(entry.split()) for entry in re.findall(r"^- (.*?)(?=^- |^#|\Z)", text, re.DOTALL | re.MULTILINE)]


def files():
    found = [
        path for place in PLACES for ending in ("py", "md", "toml") for path in (ROOT / place).rglob(f"*.{ending}")
    ]
    return sorted({*found, ROOT / "cli.py", ROOT / "README.md", ROOT / "CHANGELOG.md"} - {PAGE})


LISTED = entries(PAGE.read_text(encoding="utf-8"))


def missing(text):
    cited, titles = citations(text)
    heads = [entry.split("*")[0] for entry in LISTED]  # authors and year
    lacking = [
        f"{' & '.join(names)} {year}"
        for names, year in cited
        if not any(year in head and all(name in head for name in names) for head in heads)
    ]
    return sorted(lacking + [title for title in titles if title.lower() not in " ".join(LISTED).lower()])


def test_every_work_cited_is_listed():
    for path in files():
        if path.name != "test_references.py":
            assert missing(path.read_text(encoding="utf-8")) == [], path


def test_works_are_listed_once_and_in_full():
    for entry in LISTED:
        assert re.match(r"[^*]+ \(\d{4}(–\d{4})?\)\. \*.+\.\*", entry), entry
    assert len({entry.split("*")[1] for entry in LISTED}) == len(LISTED) > 45
    assert any("Theoharis" in entry for entry in LISTED)
    assert any("Zhukov" in entry for entry in LISTED)
