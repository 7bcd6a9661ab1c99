"""The site is built without a warning, fetches nothing, and has its formulas as MathML."""

import re
import subprocess
import sys

import pytest
from project import ROOT


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path):
    for package in ("sphinx", "furo", "myst_parser"):
        pytest.importorskip(package, reason="pip install '.[docs]'")
    options = ("-m", "sphinx", "--builder", "html", "--fail-on-warning", "--keep-going", "-d", tmp_path / "doctrees")
    built = subprocess.run(
        [sys.executable, *options, ROOT / "docs", tmp_path / "site"], capture_output=True, text=True, check=False
    )
    assert built.returncode == 0, built.stderr
    text = (tmp_path / "site" / "api" / "ao.html").read_text()
    for word in ("cosθ dω", "Exponential", "half_distance", "Float64s"):
        assert word in text
    for noise in ("FieldInfo", "TypeAliasForwardRef", "dtype["):
        assert noise not in text
    formula = (tmp_path / "site" / "models" / "lambert.html").read_text()
    assert re.search(r"<math.*<mfrac>\s*<mi>ρ</mi>\s*<mi>π</mi>\s*</mfrac>", formula, re.S)
    pages = [*(tmp_path / "site").rglob("*.html")]
    fetched = {url for page in pages for url in re.findall(r'(?:src|<link[^>]*href)="(https?:[^"]+)', page.read_text())}
    assert len(pages) > 35
    assert fetched == set()
