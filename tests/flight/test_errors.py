"""What is said of a file that is not there."""

from pathlib import Path

import pytest

from flight import errors


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("walk.jsn", "walk.jsn does not exist; {folder}/walk.json does; it should hold a trajectory"),
        ("other.csv", "other.csv does not exist in {folder}; it should hold a trajectory"),
        ("none/walk.json", "walk.json does not exist: there is no folder {folder}/none; it should hold a trajectory"),
        ("logs", "{folder}/logs is a folder, not a file; it should hold a trajectory"),
    ],
)
def test_a_file_that_is_not_there_is_named_with_what_may_have_been_meant(tmp_path, asked, said):
    (tmp_path / "walk.json").touch()
    (tmp_path / "logs").mkdir()
    told = str(errors.missing(tmp_path / asked, "a trajectory"))
    assert told.endswith(said.format(folder=tmp_path))


def test_without_what_it_should_hold_only_the_place_is_said(tmp_path):
    assert str(errors.missing(tmp_path / "none")) == f"{tmp_path}/none does not exist in {tmp_path}"


def test_a_folder_that_cannot_be_listed_only_costs_the_hint(tmp_path, monkeypatch):
    def refused(_: Path):
        raise PermissionError("not allowed")

    (tmp_path / "walk.json").touch()
    monkeypatch.setattr(Path, "iterdir", refused)
    assert str(errors.missing(tmp_path / "walk.jsn")) == f"{tmp_path}/walk.jsn does not exist in {tmp_path}"
