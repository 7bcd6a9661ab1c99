"""Progress bars and summaries: what they count, and that they end full."""

import io
import json
import re
import time
from contextlib import redirect_stderr, redirect_stdout
from types import SimpleNamespace

import numpy as np
import pytest
from meshes import hills

from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.scenes.commands.render import show_picture
from obscurance.scenes.geometry.polyhedra import icosphere
from obscurance.scenes.show.progress import progress


class Terminal(io.StringIO):
    encoding = "utf-8"

    def isatty(self):
        return True


@pytest.fixture
def terminal(monkeypatch):
    """A context, since pytest puts its own standard error in place after fixtures are made."""
    monkeypatch.setenv("TERM", "xterm")
    return lambda: redirect_stderr(Terminal())


@pytest.fixture
def set_clock(monkeypatch):
    """A function: let progress read the time from another function."""

    def let(read):
        monkeypatch.setattr("obscurance.scenes.show.progress.time", SimpleNamespace(perf_counter=read))

    return let


def percentages(text):
    return [int(part.split()[-1]) for part in text.split(" %")[:-1]]


def test_a_bar_ends_full_though_the_work_was_less_than_expected(terminal):
    with terminal() as screen, progress(False, "rays") as (advance,):
        for done in (100, 200, 300):
            advance(done, 1000)
    assert percentages(screen.getvalue())[-1] == 100


def test_the_bar_of_a_bake_to_a_tolerance_ends_full(terminal):
    with terminal() as screen, progress(False, "rays") as (advance,):
        ao.bake(Mesh(*icosphere(3)), samples=512, tolerance=0.002, progress=advance)
    assert percentages(screen.getvalue())[-1] == 100


def test_a_bar_whose_total_grows_goes_on(terminal):
    with terminal() as screen, progress(False, "rays") as (advance,):
        for done, total in ((50, 100), (100, 100), (150, 400), (200, 400)):
            advance(done, total)
    assert percentages(screen.getvalue())[-1] == 100


def test_bars_follow_each_other_and_both_end_full(terminal):
    with terminal() as screen, progress(False, "rays", "tiles") as (first, second):
        first(1, 10)
        first(4, 10)
        second(1, 4)
    shown = percentages(screen.getvalue())
    assert shown.count(100) >= 2
    assert shown[-1] == 100


def test_a_bar_of_work_that_failed_does_not_look_done(terminal):
    with terminal() as screen, pytest.raises(KeyboardInterrupt):
        interrupted_at_a_tenth()
    assert 100 not in percentages(screen.getvalue())


def interrupted_at_a_tenth():
    with progress(False, "rays") as (advance,):
        advance(1, 10)
        raise KeyboardInterrupt


def test_each_stage_of_a_texture_has_a_bar_with_its_label(terminal):
    mesh = Mesh(*hills(30))
    low, high = mesh.bounds
    uv = ((mesh.vertices - low) / (high - low))[:, :2]
    with terminal() as screen, progress(False, "rays") as (advance,):
        ao.bake_texture(mesh, uv, size=64, tolerance=0.005, progress=advance)
    shown = screen.getvalue()
    labels = "coverage", "rays, round 1", "rays, round 2", "seams"
    places = [shown.find(label) for label in labels]
    assert -1 not in places
    assert places == sorted(places)
    assert percentages(shown)[-1] == 100


def test_nothing_is_said_to_who_wants_quiet():
    with progress(True, "rays", "tiles") as advances:
        assert advances == (None, None)


def test_off_a_terminal_there_is_a_line_every_ten_seconds_also_of_a_stage_that_says_nothing_more(monkeypatch, capsys):
    said = []

    def lines(count):
        while len(said) < count:
            time.sleep(0.01)
            said.extend(capsys.readouterr().err.splitlines())
        return said[:count]

    monkeypatch.setattr("obscurance.scenes.show.progress._EVERY_LINE", 0.1)
    with progress(False, "rays", "tiles") as (rays, tiles):
        rays(0, 4 * 10**9, "rays, round 2")
        rays(10**9, 4 * 10**9, "rays, round 2")
        assert re.fullmatch(r"obscurance: rays, round 2: 25 %, [\d.]+ M rays/s", lines(3)[2])
        tiles(1, 4)
        assert lines(6)[5] == "obscurance: tiles: 25 %"
    monkeypatch.setattr("obscurance.scenes.show.progress._LATE", 0.01)
    with progress(False, "reading"):
        assert lines(8)[7] == "obscurance: reading: 0 %"
    with progress(True, "writing"):
        time.sleep(0.2)
    assert capsys.readouterr().err == ""


def test_progress_as_json_is_a_line_for_what_is_new_and_for_the_end(set_clock, capsys):
    clock = iter([0.0, 1.0, 1.05, 1.2, 1.21, 2.0])
    set_clock(lambda: next(clock))
    with progress(True, "rays", "tiles", form="json") as (rays, tiles):
        for done in (1, 2, 3, 4):
            rays(done, 4)
        tiles(1, 2)
    lines = [json.loads(line) for line in capsys.readouterr().err.splitlines()]
    assert [(line["unit"], line["done"], line["total"], line["seconds"]) for line in lines] == [
        ("rays", 1, 4, 1.0),
        ("rays", 3, 4, 1.2),
        ("rays", 4, 4, 1.21),
        ("tiles", 1, 2, 2.0),
    ]
    assert {line["event"] for line in lines} == {"progress"}


def shown(monkeypatch, pixels, columns, **environment):
    """The characters and colours, upper and lower, that a terminal of so many columns shows."""
    for name, value in {"TERM": "xterm-256color", "COLORTERM": "truecolor", "COLUMNS": columns, **environment}.items():
        monkeypatch.setenv(name, str(value))
    with redirect_stdout(Terminal()) as screen:
        show_picture(np.asarray(pixels, np.float32))
    pattern = r"\x1b\[38;2;(\d+);(\d+);(\d+);48;2;(\d+);(\d+);(\d+)m(.)"
    return [
        [(*map(int, found[:6]), found[6]) for found in re.findall(pattern, line)]
        for line in screen.getvalue().splitlines()
    ]


def test_a_terminal_shows_two_rows_of_pixels_a_line(monkeypatch):
    pixels = np.zeros((4, 3, 3))
    pixels[0, 0], pixels[1, 0], pixels[3, 2, 1] = 1, (1, 0, 0), 0.5
    lines = shown(monkeypatch, pixels, 80)
    assert [len(line) for line in lines] == [3, 3]
    assert lines[0][0] == (255, 255, 255, 255, 0, 0, "▀")
    assert lines[1][2] == (0, 0, 0, 0, 188, 0, "▀")


def test_a_picture_wider_than_the_terminal_is_averaged(monkeypatch):
    pixels = np.zeros((60, 120, 4))
    pixels[:, ::2, :3] = 1
    lines = shown(monkeypatch, pixels, 40)
    assert (len(lines), {len(line) for line in lines}) == (10, {40})
    assert {line[5][0] for line in lines} <= {156, 188, 213}
    assert shown(monkeypatch, pixels[:, :, :3] * 0 + 1, 40)[3][7] == (255,) * 6 + ("▀",)
