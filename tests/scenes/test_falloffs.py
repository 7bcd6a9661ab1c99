"""Falloffs by name, and tables of μ in files."""

import numpy as np
import pytest

from obscurance import ao
from obscurance.raytrace.errors import InputError
from obscurance.scenes.falloffs import make_falloff, read_table

TABLE = ao.Tabulated([0, 0.5, 2], [0, 0.75, 1])
TEXTS = {
    "commas and names": "distance,value\n0,0\n0.5,0.75\n2,1\n",
    "semicolons": "0;0\n.5;.75\n2;1",
    "blanks and remarks": "# attenuation\n  0 0\n\n0.5\t7.5e-1 # a knee\n2 1\n",
    "a byte order mark": "\ufeff0, 0\r\n0.5, 0.75\r\n2, 1\r\n",
}


@pytest.mark.parametrize("name", TEXTS)
def test_a_table_of_text(tmp_path, name):
    path = tmp_path / "mu.csv"
    path.write_text(TEXTS[name], "utf-8")
    assert read_table(path).resolve(1.0) == TABLE.resolve(1.0)
    assert make_falloff(f"table:{path}") == read_table(path)


def test_a_table_of_percentages(tmp_path):
    (tmp_path / "mu.txt").write_text("0 0\n5% 0.75\n20% 1\n")
    assert read_table(tmp_path / "mu.txt").resolve(10.0) == TABLE.resolve(1.0)


def test_a_table_of_numpy(tmp_path):
    np.save(tmp_path / "mu.npy", np.array([[0, 0], [0.5, 0.75], [2, 1]], np.float32))
    assert read_table(tmp_path / "mu.npy").resolve(1.0) == TABLE.resolve(1.0)


WRONG = {
    "mu.csv: line 2: expected a distance and a value, got '1,2,3'": b"0,0\n1,2,3\n",
    "mu.csv: line 3: expected a distance and a value, got 'far,1'": b"d,mu\n0,0\nfar,1\n",
    "mu.csv: line 1: expected a distance and a value, got '0,0,0'": b"0,0,0\n",
    "mu.csv: values: expected one for each of 2 to 65,536 distances, got 0 for 0": b"",
    "mu.csv: values: expected numbers that rise from 0 to 1, or stay, got 0.5 in row 3": b"0,0\n1,.7\n2,.5\n3,1\n",
    "mu.csv: content: expected two columns": b"\xff\xfe0",
    "mu.npy: content: expected two columns, distances and values, got shape (3,) of float64": np.zeros(3),
    "mu.npy: content: expected two columns": b"no array",
    "mu.npy: content: expected two columns, distances and": np.array([[None, 1]]),
    "mu.csv: content: expected at most 65,536 rows": b"0,0\n" * (1 << 23),
}


@pytest.mark.parametrize("message", WRONG)
def test_what_is_no_table_is_refused_in_one_line(tmp_path, message):
    path, content = tmp_path / message.partition(":")[0], WRONG[message]
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        np.save(path, content)
    with pytest.raises(InputError) as caught:
        read_table(path)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
