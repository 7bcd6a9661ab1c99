"""Progress bars and summaries: what they count, and that they end full."""

import io
import sys

import pytest

import ao
from raytrace import Mesh
from scenes.commands.console import progress
from scenes.geometry.polyhedra import icosphere


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def terminal(monkeypatch):
    """A function, since pytest puts its own standard error in place after fixtures are made."""
    monkeypatch.setenv("TERM", "xterm")

    def make():
        monkeypatch.setattr(sys, "stderr", Terminal())
        return sys.stderr

    return make


def percentages(text):
    return [int(part.split()[-1]) for part in text.split(" %")[:-1]]


def test_a_bar_ends_full_though_the_work_was_less_than_expected(terminal):
    screen = terminal()
    with progress(False, "rays") as (advance,):
        for done in (100, 200, 300):
            advance(done, 1000)
    assert percentages(screen.getvalue())[-1] == 100


def test_the_bar_of_a_bake_to_a_tolerance_ends_full(terminal):
    screen = terminal()
    with progress(False, "rays") as (advance,):
        ao.bake(Mesh(*icosphere(5)), samples=512, tolerance=0.002, progress=advance)
    assert percentages(screen.getvalue())[-1] == 100


def test_a_bar_whose_total_grows_goes_on(terminal):
    screen = terminal()
    with progress(False, "rays") as (advance,):
        for done, total in ((50, 100), (100, 100), (150, 400), (200, 400)):
            advance(done, total)
    assert percentages(screen.getvalue())[-1] == 100


def test_bars_follow_each_other_and_both_end_full(terminal):
    screen = terminal()
    with progress(False, "rays", "tiles") as (first, second):
        first(1, 10)
        first(4, 10)
        second(1, 4)
    shown = percentages(screen.getvalue())
    assert shown.count(100) >= 2
    assert shown[-1] == 100


def test_a_bar_of_work_that_failed_does_not_look_done(terminal):
    screen = terminal()
    with pytest.raises(KeyboardInterrupt):
        interrupted_at_a_tenth()
    assert 100 not in percentages(screen.getvalue())


def interrupted_at_a_tenth():
    with progress(False, "rays") as (advance,):
        advance(1, 10)
        raise KeyboardInterrupt


def test_no_bar_where_nobody_looks():
    for quiet in (True, False):
        with progress(quiet, "rays", "tiles") as advances:
            assert advances == (None, None)
