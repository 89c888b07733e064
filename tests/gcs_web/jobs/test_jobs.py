"""Background jobs: one queue, real processes; cancel and the station's death leave nothing behind."""

import subprocess
import sys
from pathlib import Path

import msgspec
import pytest

from flight import InputError, project
from gcs_web.jobs.jobs import Jobs, Kind
from gcs_web.protocol.jobs import StartJob
from goshawk.rendered import world as rendered_world
from goshawk.station_jobs import map_images, plan_batch
from mapping import rig
from tests.gcs_web.jobs.kinds import KINDS, Arguments, Given, echo, hold_on, say, say_given
from tests.waiting import until


@pytest.fixture
def jobs(tmp_path: Path):
    ended: list[str] = []
    opened = project.create(tmp_path / "project", "jobs")
    running = Jobs(
        opened, KINDS, lambda: None, lambda kind, result: kind.done(None, result), lambda job: ended.append(job.words)
    )
    yield running
    running.close()


def states(jobs: Jobs) -> list[tuple[str, str]]:
    return [(job.state, job.words) for job in jobs.state().jobs]


def alive(pid: int) -> bool:
    status = Path(f"/proc/{pid}/status")
    return status.exists() and "State:\tZ" not in status.read_text()


def holding(folder: Path) -> list[int]:
    until(lambda: (folder / "pids").exists() and (folder / "pids").read_text(), "the job's children")
    return [int(pid) for pid in (folder / "pids").read_text().split()]


def test_jobs_run_one_after_the_other_and_keep_what_came_of_them(jobs: Jobs):
    for kind in ("refuse", "crash", "say"):
        jobs.start(kind, {"word": kind}, "Ada")
    until(lambda: not any(state in ("waiting", "running") for state, _ in states(jobs)), "all jobs")
    refused, crashed, said = states(jobs)
    assert said == ("done", "said saysay")
    assert refused == ("failed", "'refuse' cannot be said; say another word")
    assert crashed[0] == "failed"
    assert "SIGABRT" in crashed[1]
    with pytest.raises(InputError, match="ended already"):
        jobs.cancel(1)
    jobs.forget(1)
    assert [job.id for job in jobs.state().jobs] == [2, 3]


def test_a_job_that_lacks_a_library_says_which_extra_brings_it(jobs: Jobs):
    jobs.start("lack", {"word": "image"}, "Ada")
    until(lambda: states(jobs)[0][0] == "failed", "the job's end")
    said = 'this needs opencv-python-headless, which comes with an extra: pip install "goshawk[map]"'
    assert states(jobs)[0][1] == said


def test_cancel_ends_a_deaf_job_with_its_children_within_a_second_and_the_next_one_starts(jobs: Jobs, tmp_path: Path):
    first = jobs.start("hold_on", {"word": "x"}, "Ada")
    second, third = (jobs.start("say", {"word": "y"}, "Bo") for _ in range(2))
    pids = holding(tmp_path / "project")
    jobs.cancel(second)
    assert [state for state, _ in states(jobs)] == ["running", "cancelled", "waiting"]
    jobs.cancel(first)
    until(lambda: states(jobs)[0][0] == "cancelled", "the end of the job")
    until(lambda: not any(map(alive, pids)), "the end of its children")
    until(lambda: states(jobs)[2] == ("done", "said yy"), "the job after it")
    assert third == 3


def test_a_second_job_of_the_same_result_is_refused_before_the_queue(tmp_path: Path):
    def written(opened: project.Project, asked: Arguments) -> Path:
        return opened.folder / asked.word

    opened = project.create(tmp_path / "project", "jobs")
    kind = Kind("hold_on", "Hold on", Arguments, hold_on, echo, writes=written)
    jobs = Jobs(opened, [kind], lambda: None, lambda kind, result: kind.done(None, result), lambda _: None)
    try:
        first = jobs.start("hold_on", {"word": "lap"}, "Ada")
        with pytest.raises(InputError, match="Ada started 'Hold on' already, which writes lap: wait for its result"):
            jobs.start("hold_on", {"word": "lap"}, "Bo")
        jobs.start("hold_on", {"word": "loop"}, "Bo")
        assert len(jobs.state().jobs) == 2
        jobs.cancel(first)
        until(lambda: states(jobs)[0][0] == "cancelled", "the end of the first job")
        jobs.start("hold_on", {"word": "lap"}, "Bo")
    finally:
        jobs.close()


def test_jobs_end_for_another_project_only_when_none_runs_or_waits_and_then_none_is_taken(jobs: Jobs, tmp_path: Path):
    first = jobs.start("hold_on", {"word": "x"}, "Ada")
    holding(tmp_path / "project")
    assert not jobs.end_if_idle()
    jobs.cancel(first)
    until(lambda: states(jobs)[0][0] == "cancelled", "the end of the job")
    assert jobs.end_if_idle()
    with pytest.raises(InputError, match="this project is being closed"):
        jobs.start("say", {"word": "y"}, "Bo")


@pytest.mark.parametrize(
    ("kind", "arguments", "said"),
    [
        ("nothing", {}, "there is no job 'nothing'"),
        ("say", {}, "missing required field `word`"),
        ("say", {"word": 3}, "Expected `str`"),
        ("say", {"word": "x" * 21}, "length <= 20"),
        ("say", {"word": "x", "steps": 6}, "<= 5"),
        ("say", {"word": "x", "steps": float("nan")}, "Expected `int`"),
        ("say", {"word": "x", "shell": "rm"}, "unknown field `shell`"),
    ],
)
def test_arguments_that_are_not_valid_are_refused_before_the_queue(jobs: Jobs, kind, arguments, said):
    with pytest.raises(InputError, match=said):
        jobs.start(kind, arguments, "Ada")
    assert jobs.state().jobs == []


def test_the_form_of_a_kind_is_told_by_its_arguments(jobs: Jobs):
    word, steps = jobs.state().kinds[0].fields
    assert (word.form, word.title, word.default) == ("text", "Word", "")
    assert (steps.form, steps.default, steps.unit) == ("integer", 2, "steps")


STATION = """
import sys
from pathlib import Path
from flight import project
from gcs_web.jobs.jobs import Jobs
from tests.gcs_web.jobs import kinds
opened = project.open_project(Path(sys.argv[1]))
jobs = Jobs(opened, kinds.KINDS, lambda: None, lambda k, r: "", lambda j: None)
jobs.start("hold_on", {"word": "x"}, "Ada")
import threading; threading.Event().wait()
"""


def test_kill_9_of_the_station_ends_the_job_with_its_children(tmp_path: Path):
    project.create(tmp_path, "killed")
    station = subprocess.Popen([sys.executable, "-c", STATION, str(tmp_path)])
    pids = holding(tmp_path)
    assert all(map(alive, pids))
    station.kill()
    station.wait()
    until(lambda: not any(map(alive, pids)), "the end of the job")


def test_a_folder_that_cannot_be_read_does_not_keep_the_station_from_opening(tmp_path: Path, monkeypatch):
    """A project at the root of a disk has `lost+found`."""
    opened = project.create(tmp_path / "project", "disk")
    for name, file in (("lost+found", "x"), ("photos", "a.jpg"), ("tasks", "a.json")):
        (opened.folder / name).mkdir()
        (opened.folder / name / file).touch()
    readable = Path.iterdir

    def iterdir(folder: Path):
        if folder.name == "lost+found":
            raise PermissionError(13, "Permission denied", str(folder))
        return readable(folder)

    monkeypatch.setattr(Path, "iterdir", iterdir)
    assert map_images.image_folders(opened) == ["photos"]
    assert plan_batch.folders(opened) == ["tasks"]


def test_what_the_map_job_would_do_is_said_before_it_is_started(tmp_path: Path):
    opened = project.create(tmp_path / "project", "map")
    rig.save(opened.folder / "camera.toml", rendered_world.default_rig())
    names = [camera.name for camera in rendered_world.default_rig().cameras]
    folders = [camera.folder for camera in rendered_world.default_rig().cameras]
    for i, folder in enumerate(folders):
        (opened.folder / "walk" / folder).mkdir(parents=True, exist_ok=True)
        for k in range(i + 2):
            (opened.folder / "walk" / folder / f"{k}.png").write_bytes(b"")
    jobs = Jobs(opened, [map_images.KIND], lambda: None, lambda _k, _r: "", lambda _: None)
    asked = {"images": "walk", "camera": "camera.toml"}
    try:
        said = jobs.foresee("map", asked)
        assert all(f"{name}: {i + 2} images" in said for i, name in enumerate(names))
        (opened.folder / "walk" / folders[0] / "0.png").unlink()
        (opened.folder / "walk" / folders[0] / "1.png").unlink()
        assert f"no image of {names[0]} is where the camera file says" in jobs.foresee("map", asked)
        opened.map.mkdir()
        with pytest.raises(InputError, match="the project has a map"):
            jobs.foresee("map", asked)
        assert "the present map is kept beside" in jobs.foresee("map", asked | {"overwrite": True})
        assert jobs.state().jobs == []
    finally:
        jobs.close()


def test_choices_that_cannot_be_found_leave_the_list_of_jobs_and_are_looked_up_when_asked_for(tmp_path: Path):
    looked: list[int] = []

    def choices(_: project.Project) -> dict[str, list[str]]:
        looked.append(1)
        raise PermissionError(13, "Permission denied")

    kind = Kind("say", "say", Arguments, say, echo, choices)
    opened = project.create(tmp_path / "project", "jobs")
    jobs = Jobs(opened, [kind], lambda: None, lambda kind, result: kind.done(None, result), lambda _: None)
    try:
        for _ in range(5):
            assert [offered.name for offered in jobs.state().kinds] == ["say"]
        assert len(looked) == 1
        jobs.look()
        assert len(looked) == 2
    finally:
        jobs.close()


def test_a_whole_number_of_a_form_stays_whole_on_its_way():
    sent = b'{"type": "start_job", "serial": 0, "kind": "say", "arguments": {"word": "a", "steps": 3}}'
    assert msgspec.convert(msgspec.json.decode(sent, type=StartJob).arguments, Arguments) == Arguments("a", 3)


@pytest.mark.parametrize(("given", "way_out"), [(lambda _: {}, "or cancel it$"), (None, "or choose another name$")])
def test_nobody_is_told_to_choose_another_name_of_what_the_station_names(tmp_path: Path, given, way_out):
    opened = project.create(tmp_path / "project", "jobs")
    kind = Kind("hold_on", "Hold on", Arguments, hold_on, echo, writes=lambda *_: tmp_path / "lap", given=given)
    jobs = Jobs(opened, [kind], lambda: None, lambda kind, result: kind.done(None, result), lambda _: None)
    try:
        jobs.start("hold_on", {"word": "lap"}, "Ada")
        with pytest.raises(InputError, match=way_out):
            jobs.start("hold_on", {"word": "lap"}, "Bo")
    finally:
        jobs.close()


def test_what_the_station_gives_is_asked_of_nobody_and_counts_against_what_a_page_sends(tmp_path: Path):
    given = Kind("say", "Say", Given, say_given, lambda _, said: said, given=lambda _: {"word": "ours"})
    opened = project.create(tmp_path / "project", "jobs")
    jobs = Jobs(
        opened, [given], lambda: None, lambda kind, result: kind.done(None, result), lambda _: None,
        on_start=lambda kind: kind.given(None) if kind.given is not None else {},
    )  # fmt: skip
    try:
        assert [field.name for field in jobs.state().kinds[0].fields] == ["steps"]
        jobs.start("say", {"word": "theirs", "steps": 2}, "Ada")
        until(lambda: states(jobs)[0] == ("done", "oursours"), "the words")
    finally:
        jobs.close()
