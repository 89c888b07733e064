"""What was opened before is offered, the newest first, and only as long as it is there."""

import errno
import os
import shutil
from pathlib import Path

import pytest

from flight import InputError, project
from gcs_web.document import projects, recent
from tests.waiting import goshawk


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "state" / "recent.json"


def made(folder: Path) -> Path:
    return project.create(folder, folder.name).folder


def test_the_newest_is_first_and_each_is_there_once(file, tmp_path):
    yard, hall = made(tmp_path / "a" / "yard"), made(tmp_path / "b" / "hall")
    for folder in (yard, hall, yard):
        recent.note(file, folder)
    assert recent.listed(file) == [yard, hall]
    shutil.rmtree(yard)
    assert recent.listed(file) == [hall]


@pytest.mark.parametrize("text", ["", "{", "{}", "[1, null]", '["/nowhere"]'])
def test_a_file_that_is_no_such_list_is_none_and_is_written_anew(file, tmp_path, text):
    file.parent.mkdir()
    file.write_text(text)
    assert recent.listed(file) == []
    recent.note(file, made(tmp_path / "yard"))
    assert recent.listed(file) == [tmp_path / "yard"]


def test_a_card_that_is_not_plugged_in_is_not_offered_and_not_forgotten(file, tmp_path):
    card, yard = made(tmp_path / "card" / "hall"), made(tmp_path / "yard")
    recent.note(file, card)
    (tmp_path / "card").rename(tmp_path / "out")
    recent.note(file, yard)
    assert recent.listed(file) == [yard]
    (tmp_path / "out").rename(tmp_path / "card")
    assert recent.listed(file) == [yard, card]


@pytest.mark.parametrize("error", [errno.EACCES, errno.ENOTCONN, errno.ESTALE])
def test_a_folder_of_a_network_that_does_not_answer_keeps_no_other_from_being_opened(
    file, tmp_path, monkeypatch, error
):
    far, yard = made(tmp_path / "far" / "hall"), made(tmp_path / "yard")
    recent.note(file, far)
    stat = os.stat

    def dropped(path, *args, **kwargs):
        if "far" in Path(path).parts:
            raise OSError(error, os.strerror(error))
        return stat(path, *args, **kwargs)

    monkeypatch.setattr(os, "stat", dropped)
    recent.note(file, yard)
    assert recent.listed(file) == [yard]
    assert [entry.name for entry in projects.beside(project.open_project(yard))] == ["yard"]


def test_only_so_many_are_remembered(file, tmp_path):
    for k in range(recent.MOST + 3):
        recent.note(file, made(tmp_path / f"p{k}"))
    listed = recent.listed(file)
    assert len(listed) == recent.MOST
    assert listed[0].name == f"p{recent.MOST + 2}"


def test_where_nothing_can_be_written_nothing_is_remembered(tmp_path):
    (tmp_path / "file").write_text("")
    recent.note(tmp_path / "file" / "recent.json", made(tmp_path / "yard"))


def test_those_of_elsewhere_come_after_the_neighbours_and_say_where_they_are(tmp_path):
    yard, hall, far = (made(tmp_path / path) for path in ("a/yard", "a/hall", "b/far"))
    listed = projects.offered(project.open_project(yard), [far, hall])
    assert [(entry.name, entry.where) for entry in listed] == [("hall", ""), ("yard", ""), ("far", "b")]
    entry, folder = projects.found(project.open_project(yard), [far, hall], listed[-1].folder)
    assert (entry.name, folder) == ("far", far)
    assert str(tmp_path) not in str(listed)  # of a damaged one too
    (far / "project.toml").write_text("not toml")
    assert str(tmp_path) not in str(projects.offered(project.open_project(yard), [far]))


def test_a_new_project_is_made_beside_and_never_over_something(tmp_path):
    yard = project.open_project(made(tmp_path / "yard"))
    assert projects.create_beside(yard, " lap 3 ") == tmp_path / "lap 3"
    assert project.open_project(tmp_path / "lap 3").name == "lap 3"
    (tmp_path / "file").write_text("")
    for name in ("lap 3", "file", "yard", "../x", "", ".hidden", "<b>"):
        with pytest.raises(InputError):
            projects.create_beside(yard, name)
    assert not (tmp_path.parent / "x").exists()
    (tmp_path / "dangling").symlink_to(tmp_path / "nowhere")
    with pytest.raises(InputError, match="something named"):
        projects.create_beside(yard, "dangling")


def test_where_no_folder_can_be_made_the_refusal_says_why_without_a_path(tmp_path, monkeypatch):
    yard = project.open_project(made(tmp_path / "yard"))

    def refuse(*_: object) -> None:
        raise PermissionError(errno.EACCES, "Permission denied", str(tmp_path))

    monkeypatch.setattr(project, "create", refuse)
    with pytest.raises(InputError, match=r"cannot be made beside this project: Permission denied$"):
        projects.create_beside(yard, "lap")


def test_without_a_project_the_last_one_is_opened_and_without_any_it_is_said_how_to_make_one(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    none = goshawk("gcs")
    assert none.returncode == 2
    assert "goshawk init my-room makes one" in none.stderr
    last = made(tmp_path / "yard")
    recent.note(recent.default_file(), last)
    (last / "project.toml").write_text("not toml")
    said = goshawk("gcs")
    assert said.returncode == 2
    assert f"opening {last}" in said.stderr
