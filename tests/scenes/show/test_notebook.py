"""Notebooks show the page of a bake."""

import html
import re
import tomllib
from importlib import import_module
from types import SimpleNamespace

import numpy as np
from meshes import hills, two_boxes
from pages import columns_of, facts_of
from project import ROOT

from obscurance import ao
from obscurance.raytrace import Mesh
from obscurance.scenes.show.page import document


def test_the_page_is_whole_within_its_frame():
    bake = ao.bake(Mesh(*two_boxes()), samples=8)
    shown = document.framed_page(bake)
    page = html.unescape(re.fullmatch('<iframe srcdoc="([^"]*)" [^<>]*></iframe>', shown)[1]).encode()
    assert abs(columns_of(page)["w0"] / 65535 - bake.w).max() <= 1 / 65535
    assert facts_of(page)["up"] == "y"
    named = ao.bake(Mesh(*two_boxes(), source="folder/boxes.stl", up="z"), samples=8)
    page = html.unescape(document.framed_page(named)).encode()
    assert (facts_of(page)["up"], facts_of(page)["title"]) == ("z", "boxes.stl")


def test_the_rmse_is_that_of_the_bake():
    """By the surface method it is not that over all vertices: a box inside another is not in sight."""
    bake = ao.bake(Mesh(*two_boxes()), samples=64, method="surface")
    assert abs(bake.rmse - np.sqrt(np.mean(bake.error**2))) > 0.01 * bake.rmse
    assert facts_of(html.unescape(document.framed_page(bake)).encode())["bakes"][0]["rmse"] == bake.rmse


def test_a_large_mesh_is_left_to_the_picture():
    assert document.framed_page(SimpleNamespace(mesh=Mesh(*hills(501)))) is None


def test_the_entry_point_of_the_package_is_this():
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]["obscurance.html"]
    (target,) = declared.values()
    module, _, name = target.partition(":")
    assert getattr(import_module(module), name) is import_module("obscurance.scenes.show.page.document").framed_page
