"""Reports of the commands: JSON and page have the same values, and say what to do and how to repeat it."""

import hashlib
import html
import json
import re
import shlex
import tempfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from command import obscurance, succeeded
from mesh_files import obj
from meshes import crumpled, hills
from pages import facts_of

from obscurance.raytrace import Mesh
from obscurance.raytrace.image.colour import encode_srgb
from obscurance.raytrace.image.read import read_image
from obscurance.scenes.show.report.pictures import pictures_of_page, pictures_of_vertices

FLOOR_AND_WALL = """v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nv -1 1 1\nv 1 1 1
vt .05 .05\nvt .95 .05\nvt .95 .45\nvt .05 .45\nvt 1.05 .55\nvt 1.95 .55\nvt 1.95 .95\nvt 1.05 .95
vn 0 -1 1\nf 1/1/1 2/2/1 3/3/1 4/4/1\nf 4/5/1 3/6/1 6/7/1 5/8/1\n"""
LINES = {
    "vertex": "bake hills.obj -o w.npz --samples 16 --no-denoise --seed 7",
    "tolerance": "bake hills.obj -o w.npy --tolerance 0.0001 --samples 32 --max-distance 40%",
    "surface": "bake hills.obj -o w.ply --method surface --samples 16 --quiet",
    "render": "render hills.obj -o p.exr --width 48 --height 32 --no-shadows",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("reports")
    (made / "hills.obj").write_bytes(obj(*crumpled(hills(16), 0.3, 3)))
    return made


@pytest.fixture(scope="module")
def reports(folder):
    """By name: the JSON, the page as text, and both commands' outputs."""
    found = {}
    for name, line in LINES.items():
        for ending in (".json", ".html"):
            done = run(folder, line, "--report", folder / f"{name}{ending}")
            assert done.returncode == 0, done.stderr
        found[name] = json.loads((folder / f"{name}.json").read_text()), (folder / f"{name}.html").read_text()
    return found


def run(folder, line, *more):
    words = [
        folder / word if re.fullmatch(r"\w+\.\w+", word) and word[0].isalpha() else word for word in shlex.split(line)
    ]
    return obscurance(*words, *more)


def visible(page):
    """What a reader of the page sees, on one line."""
    body = page[page.index("<body>") :]
    return " ".join(html.unescape(re.sub("<[^>]*>", " ", body)).split())


@pytest.mark.parametrize("name", LINES)
def test_the_page_has_what_the_json_has(reports, name):
    report, page = reports[name]
    text = visible(page)
    for finding in report["verdict"]["findings"]:
        assert finding["what"] in text
        assert finding["do"] in text
    notes = [finding["level"] for finding in report["verdict"]["findings"]].count("note")
    well = f"Done, with {notes} to note" if notes else "All is well"
    assert (well if report["verdict"]["good"] else "Look at this first") in text
    assert report["inputs"][0]["sha256"] in text
    rays = report["rays"] if isinstance(report["rays"], dict) else {"traced": report["rays"]}
    for count in rays.values():
        assert f"{count:,}" in text
    for stage in report["seconds"]:
        assert f"{stage} " in text
    assert report["versions"]["embree"] in text
    assert len(re.findall('<img alt="[^"]*" src="data:image/png;base64,iVBOR', page)) == (9 if name == "render" else 3)
    if "w" in report:
        assert page.count('<g class="bars">') == 2
        assert f"mean {report['w']['mean']:.3g}" in text


@pytest.mark.parametrize("name", LINES)
def test_a_page_leads_nowhere(reports, name):
    page = reports[name][1]
    assert re.search('content="default-src \'none\'; [^"]*img-src data:"', page)
    assert not re.search(r"https?:|<script|<link|url\(|@import| style=| on\w+=", page)


@pytest.mark.parametrize("name", LINES)
def test_a_report_says_what_was_read_and_how_to_repeat_it(folder, reports, tmp_path, name):
    report = reports[name][0]
    assert report["schema_version"] == 1
    content = (folder / "hills.obj").read_bytes()
    assert report["inputs"] == [
        {"path": str(folder / "hills.obj"), "bytes": len(content), "sha256": hashlib.sha256(content).hexdigest()}
    ]
    program, *words = shlex.split(report["command"])
    assert program == "obscurance"
    output = words.index("--output") + 1
    target = tmp_path / words[output].rpartition("/")[2]
    before = (folder / target.name).read_bytes()
    words[output] = target
    succeeded(*words)
    assert target.read_bytes() == before


def test_histograms_and_calibration_are_those_of_the_bake(folder, reports):
    report = reports["vertex"][0]
    baked = np.load(folder / "w.npz")
    assert sum(report["w"]["histogram"]["counts"]) == len(baked["w"])
    counts = np.histogram(baked["w"].astype(float), 40, (0, 1))[0]
    assert abs(counts - report["w"]["histogram"]["counts"]).sum() <= 4  # float32
    assert report["error"]["most"] == pytest.approx(baked["error"].max(), rel=1e-6)
    assert report["w"]["quantiles"]["0.5"] == pytest.approx(np.median(baked["w"]), abs=1e-6)
    for name in ("vertex", "tolerance"):
        found = reports[name][0]["error_calibration"]
        assert found["points"] == sum(group["points"] for group in found["groups"]) > 40
        assert 0.5 < found["measured"] / found["estimated"] < 2
    assert reports["surface"][0]["error_calibration"] is None
    assert "<circle" not in reports["surface"][1]


def test_a_tolerance_that_is_not_met_is_the_verdict(reports):
    report, page = reports["tolerance"]
    assert not report["verdict"]["good"]
    coarse, second = report["verdict"]["findings"][:2]
    assert coarse["level"] == second["level"] == "bad"
    assert "between the vertices" in coarse["what"]
    assert "tolerance of 0.0001 is not met" in second["what"]
    assert "--samples" in second["do"]
    assert "Look at this first" in page
    assert len([each for each in report["verdict"]["findings"] if "not met" in each["what"]]) == 1


def test_flags_are_counted_in_all_and_listed_in_part(folder, reports):
    report, page = reports["vertex"]
    flags = np.load(folder / "w.npz")["flags"]
    folded = np.flatnonzero(flags & 16)
    assert report["flagged"]["folded"] == len(folded) > 3
    assert report["flagged_vertices"]["folded"] == folded[:100].tolist()
    shown = ", ".join(map(str, folded[:10]))
    assert f"folded: {len(folded)} {shown}" + (", …" if len(folded) > 10 else "") in visible(page)
    assert ", ".join(map(str, folded[:11])) not in visible(page) or len(folded) <= 10
    assert any("behind one of the faces" in each["what"] for each in report["verdict"]["findings"])


def test_a_texture_has_pictures_of_its_page_and_of_the_mesh(tmp_path):
    (tmp_path / "corner.obj").write_text(FLOOR_AND_WALL)
    report = tmp_path / "r.html"
    few = ("--samples", 16, "--size", 32, "--report", report)
    succeeded("bake", tmp_path / "corner.obj", "-o", tmp_path / "w.png", *few)
    page = report.read_text()
    assert re.findall('<img alt="([^"]*)"', page) == ["w", "error", "the page: w", "the page: error"]
    assert "Values at the covered texels" in page
    succeeded("bake", tmp_path / "corner.obj", "-o", tmp_path / "w.<UDIM>.png", *few)
    tiles = re.findall("<h2>([^<]*)</h2>", report.read_text())
    assert [name.rpartition("/")[2] for name in tiles if "png" in name] == ["w.1001.png", "w.1002.png"]


def test_a_bake_from_a_fine_mesh_shows_the_coarse_one(folder, tmp_path):
    (tmp_path / "coarse.obj").write_bytes(obj(*hills(5)))
    line = "bake", tmp_path / "coarse.obj", "-o", tmp_path / "w.html", "--high", folder / "hills.obj", "--samples", 8
    succeeded(*line, "--cage", "30%", "--report", tmp_path / "r.html")
    assert "Values at 25 vertices" in visible((tmp_path / "r.html").read_text())
    assert facts_of((tmp_path / "w.html").read_bytes())["vertices"] == 25


def test_pictures_are_coloured_as_the_legend_says():
    floor = Mesh([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], [[0, 2, 1], [0, 3, 2]])
    for error, colour in ((0.5, [0xFD, 0xEA, 0xA8]), (0.0, [0x1B, 0x18, 0x38])):
        *_, picture = pictures_of_vertices(floor, np.ones(4), np.full(4, error))
        assert (picture.title, picture.top) == ("error", error)
        (centre,) = decoded(picture.png)[[200], [240]]
        assert abs(encode_srgb(centre) * 255 - colour).max() < 1.5
    page = np.tile(np.linspace(0, 1, 16, dtype=np.float32), (16, 1))
    baked = SimpleNamespace(w=page, error=page, uv=np.full((2, 3, 2), 0.5))
    w, *_ = pictures_of_page(floor, baked)
    assert abs(decoded(w.png)[200, 240] - 0.5).max() < 0.01


def decoded(png):
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "p.png").write_bytes(png)
        return read_image(Path(folder) / "p.png")[0]["beauty"][..., :3]
