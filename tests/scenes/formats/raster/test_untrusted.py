"""Rasters that name other files or addresses, or claim more cells than they hold, are refused before they are read."""

import threading
import warnings
import zipfile
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np
import pytest
from command import obscurance, refused, refused_without_a_trace, succeeded

rasterio = pytest.importorskip("rasterio")
from rasterio.io import MemoryFile  # noqa: E402
from rasterio.transform import Affine  # noqa: E402

SOURCE = "<SimpleSource><SourceFilename>{}</SourceFilename><SourceBand>1</SourceBand></SimpleSource>"
VRT = (
    '<VRTDataset rasterXSize="4" rasterYSize="4"><VRTRasterBand dataType="Byte" band="1"{}>{}</VRTRasterBand>'
    "</VRTDataset>"
)
WINDOW = (
    "<UpperLeftX>0</UpperLeftX><UpperLeftY>4</UpperLeftY><LowerRightX>4</LowerRightX><LowerRightY>0</LowerRightY>"
    "<SizeX>4</SizeX><SizeY>4</SizeY><TileLevel>0</TileLevel>"
)
KINDS = {  # {folder}, {url}
    "a VRT of a file's bytes": VRT.format(
        ' subClass="VRTRawRasterBand"', '<SourceFilename relativetoVRT="0">{folder}/secret.tif</SourceFilename>'
    ),
    "a VRT of an archive": VRT.format("", SOURCE.format("/vsizip/{folder}/secret.zip/secret.tif")),
    "a VRT of an address": VRT.format("", SOURCE.format("{url}/a.tif")),
    "a VRT by curl": VRT.format("", SOURCE.format("/vsicurl/{url}/a.tif")),
    "WMS": '<GDAL_WMS><Service name="TMS"><ServerUrl>{url}/${{z}}/${{x}}/${{y}}.png</ServerUrl></Service>'
    f"<DataWindow>{WINDOW}</DataWindow><BlockSizeX>4</BlockSizeX><BlockSizeY>4</BlockSizeY><BandsCount>1</BandsCount>"
    "</GDAL_WMS>",
    "WCS": "<WCS_GDAL><ServiceURL>{url}/?SERVICE=WCS</ServiceURL><CoverageName>a</CoverageName></WCS_GDAL>",
    "an address": "{url}/a.tif\n",
}


@pytest.fixture(scope="module")
def server():
    """The address of a server on this machine, and the paths that it is asked for."""
    asked = []

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self):
            asked.append(self.path)
            self.send_error(404)

        do_HEAD = do_GET

        def log_message(self, *_):
            pass

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as running:
        threading.Thread(target=running.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{running.server_address[1]}", asked
        running.shutdown()


def tiff(heights=None, **more):
    """A GeoTIFF of heights, or without tiles, which read as zeros."""
    form = {"driver": "GTiff", "dtype": "float32", "count": 1, "crs": "EPSG:32632", "width": 4, "height": 4}
    form |= {"transform": Affine(1, 0, 5e5, 0, -1, 5e6)} | more
    with MemoryFile() as memory:
        with memory.open(**form) as file:
            if heights is not None:
                file.write(heights.astype(form["dtype"]), 1)
        return memory.read()


@pytest.mark.parametrize("ending", [".tif", ".asc"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_raster_reads_no_other_file_and_no_address(tmp_path, server, kind, ending):
    url, asked = server
    secret = tmp_path / "secret.tif"
    secret.write_bytes(tiff(np.arange(16.0).reshape(4, 4)))
    with zipfile.ZipFile(tmp_path / "secret.zip", "w") as archive:
        archive.write(secret, secret.name)
    (tmp_path / f"m{ending}").write_text(KINDS[kind].format(folder=tmp_path, url=url))
    (tmp_path / "s.toml").write_text(f'[[objects]]\nmesh = "m{ending}"\n')
    words = f"m{ending}: ", "content: expected a raster of heights"
    occluder = "--occluder", tmp_path / f"m{ending}"
    refused_without_a_trace(tmp_path, words, "info", tmp_path / f"m{ending}")
    refused_without_a_trace(tmp_path, words, "bake", secret, *occluder, "-o", tmp_path / "w.tif")
    refused_without_a_trace(tmp_path, words, "render", tmp_path / "s.toml", "-o", tmp_path / "s.png")
    assert asked == []


@pytest.mark.parametrize("name", ["/vsicurl/{url}/a.tif", "{url}/a.tif", "/vsizip/{folder}/secret.zip/secret.tif"])
def test_a_name_is_that_of_a_file(tmp_path, server, name):
    url, asked = server
    with zipfile.ZipFile(tmp_path / "secret.zip", "w") as archive:
        archive.writestr("secret.tif", tiff(np.zeros((4, 4))))
    name = name.format(folder=tmp_path, url=url)
    refused(obscurance("info", name), "expected an existing file")
    (tmp_path / "s.toml").write_text(f'[[objects]]\nmesh = "{name}"\n')
    refused(obscurance("render", tmp_path / "s.toml", "-o", tmp_path / "s.png"), "a path in the scene's folder")
    assert asked == []


def test_a_raster_without_a_place_is_baked_without_a_word(tmp_path):
    with warnings.catch_warnings(action="ignore"):
        (tmp_path / "m.tif").write_bytes(tiff(np.arange(16.0).reshape(4, 4), transform=None))
    assert obscurance("bake", tmp_path / "m.tif", "-o", tmp_path / "w.tif", "--samples", 8, "-q").stderr == ""


def test_files_beside_a_raster_do_not_count(tmp_path):
    (tmp_path / "m.tif").write_bytes(tiff(np.arange(16.0).reshape(4, 4)))
    expected = obscurance("info", tmp_path / "m.tif").stdout
    (tmp_path / "m.tif.msk").write_bytes(tiff(np.zeros((4, 4)), dtype="uint8"))
    (tmp_path / "m.tfw").write_text("9\n0\n0\n9\n0\n0\n")
    (tmp_path / "m.tif.aux.xml").write_text(
        '<PAMDataset><PAMRasterBand band="1"><NoDataValue>3</NoDataValue></PAMRasterBand></PAMDataset>'
    )
    assert obscurance("info", tmp_path / "m.tif").stdout == expected


@pytest.mark.parametrize("side", [2000, 8000])
def test_cells_without_bytes_are_refused_before_they_are_read(tmp_path, side):
    content = tiff(width=side, height=side, tiled=True, blockxsize=512, blockysize=512, SPARSE_OK=True)
    assert len(content) < 8000
    (tmp_path / "m.tif").write_bytes(content)
    refused(obscurance("info", tmp_path / "m.tif"), "cells: expected as many as", f"got {side:,}×{side:,}")


def test_a_tile_larger_than_its_raster_is_refused(tmp_path):
    (tmp_path / "m.tif").write_bytes(tiff(tiled=True, blockxsize=1 << 14, blockysize=1 << 14, SPARSE_OK=True))
    refused(obscurance("info", tmp_path / "m.tif"), "cells", "4×4 in tiles of 16,384×16,384")


def test_a_head_of_many_cells_is_refused_in_text(tmp_path):
    head = "ncols 9000\nnrows 9000\nxllcorner 0\nyllcorner 0\ncellsize 1\n"
    (tmp_path / "m.asc").write_text(f"{head}1 2 3\n")
    refused(obscurance("info", tmp_path / "m.asc"), "cells: expected as many as", "got 9,000×9,000")


def test_cells_that_do_not_fit_into_memory_are_refused(tmp_path, monkeypatch):
    content = tiff(np.zeros((600, 600)), width=600, height=600, compress="deflate")
    (tmp_path / "m.tif").write_bytes(content)
    succeeded("info", tmp_path / "m.tif")
    monkeypatch.setattr("obscurance.raytrace.system.checks.available_memory", lambda: 25 << 20)
    refused(obscurance("info", tmp_path / "m.tif"), "memory: expected at most 25 MiB", "360,000 cells")
