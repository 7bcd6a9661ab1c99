"""Files to read: only regular ones."""

import os

import pytest

from obscurance.raytrace.errors import InputError, SceneError
from obscurance.raytrace.system.checks import check_regular


def test_regular_files_and_links_to_them_pass(tmp_path):
    (tmp_path / "a").write_bytes(b"")
    (tmp_path / "b").symlink_to(tmp_path / "a")
    check_regular(tmp_path / "a", "a scene file")
    check_regular(tmp_path / "b", "a scene file")


@pytest.mark.parametrize(
    ("name", "got"),
    [
        ("none", "an existing file, got none"),
        ("nu\0ll", "an existing file, got none"),
        (".", "a scene file, got a folder"),
        (os.devnull, "a scene file, got something that is not a regular file"),
    ],
)
def test_anything_else_is_refused(tmp_path, name, got):
    with pytest.raises(SceneError, match=got):
        check_regular(tmp_path / name, "a scene file", SceneError)


def test_the_message_names_the_source(tmp_path):
    with pytest.raises(InputError, match=r"^picture: file: expected an existing file, got none$"):
        check_regular(tmp_path / "none", "an image file", source="picture")


def test_what_the_system_refuses_passes_through(tmp_path):
    (tmp_path / "a").write_bytes(b"")
    with pytest.raises(NotADirectoryError):
        check_regular(tmp_path / "a" / "b", "a scene file")
