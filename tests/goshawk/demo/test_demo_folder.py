"""The demo runs twice in a row; what somebody did in its folder stays, and no other folder is ever touched."""

from pathlib import Path

import pytest

from flight import InputError, LinkError, project
from goshawk.demo import demo_folder
from goshawk.demo.sitl_process import TRIES, again_if_link_dies

SETTINGS = {"pairs": 60}


def write(path: Path, text: str) -> dict[str, str]:
    path.write_text(text)
    return {"text": text}


def run(out: Path, text: str, settings: dict = SETTINGS) -> dict[str, str]:
    """As much of a demo as its folder sees."""
    with demo_folder.making(out, settings) as steps:
        first = steps.do("map", lambda: write(out / "map.txt", f"map of {text}"))
        steps.do("flight", lambda: write(out / "walk.json", text))
        steps.finish(first)
    return first


def broken_off(out: Path) -> None:
    """A demo whose link dies after the first step."""

    def dies() -> dict[str, str]:
        (out / "walk.json").write_text("half of a fl")
        raise LinkError("dead")

    def demo() -> None:
        with demo_folder.making(out, SETTINGS) as steps:
            steps.do("map", lambda: write(out / "map.txt", "map of the first run"))
            steps.do("flight", dies)

    with pytest.raises(LinkError):
        demo()


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_an_unchanged_demo_is_replaced_by_the_next(tmp_path):
    for text in ("first", "second"):
        run(tmp_path / "demo", text)
    assert names(tmp_path) == ["demo"]
    assert (tmp_path / "demo" / "walk.json").read_text() == "second"


def test_a_demo_whose_folder_is_a_link_is_replaced_where_the_link_leads(tmp_path):
    (tmp_path / "disk" / "demo").mkdir(parents=True)
    (tmp_path / "demo").symlink_to("disk/demo")
    for text in ("first", "second"):
        run(tmp_path / "demo", text)
        assert (tmp_path / "disk" / "demo" / "walk.json").read_text() == text
    assert (tmp_path / "demo").is_symlink()
    assert names(tmp_path / "disk") == ["demo"]


@pytest.mark.parametrize("mine", ["walk.json", "notes.txt"])
def test_a_demo_that_was_changed_is_kept_beside(tmp_path, mine):
    run(tmp_path / "demo", "first")
    (tmp_path / "demo" / mine).write_text("mine")
    run(tmp_path / "demo", "second")
    assert names(tmp_path) == ["demo", "demo.old-1"]
    assert (tmp_path / "demo.old-1" / mine).read_text() == "mine"


def test_a_demo_that_fails_leaves_the_earlier_one_beside(tmp_path):
    run(tmp_path / "demo", "first")

    def failing() -> None:
        with demo_folder.making(tmp_path / "demo", SETTINGS):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        failing()
    assert (tmp_path / "demo.old-1" / "walk.json").read_text() == "first"


def test_another_folder_is_refused(tmp_path):
    project.create(tmp_path / "mine", "my hall")
    before = names(tmp_path / "mine")
    with pytest.raises(InputError, match="not a result"):
        run(tmp_path / "mine", "text")
    assert names(tmp_path / "mine") == before


def test_a_demo_that_was_broken_off_goes_on_after_its_last_finished_step(tmp_path, capsys):
    broken_off(tmp_path / "demo")
    assert "finished: map; the same command continues from there" in capsys.readouterr().err
    assert run(tmp_path / "demo", "second run") == {"text": "map of the first run"}
    assert "going on with the demo" in capsys.readouterr().err
    assert (tmp_path / "demo" / "walk.json").read_text() == "second run"
    run(tmp_path / "demo", "third run")
    assert names(tmp_path) == ["demo"]  # it was as complete as one made in one go
    assert names(tmp_path / "demo") == ["demo.json", "map.txt", "project.toml", "walk.json"]


def test_a_broken_off_demo_does_not_go_on_with_other_settings_or_changed_files(tmp_path):
    broken_off(tmp_path / "demo")
    assert run(tmp_path / "demo", "other", {"pairs": 8}) == {"text": "map of other"}
    broken_off(tmp_path / "two")
    (tmp_path / "two" / "map.txt").write_text("mine")
    assert run(tmp_path / "two", "new") == {"text": "map of new"}
    assert (tmp_path / "two.old-1" / "map.txt").read_text() == "mine"


def test_what_somebody_put_into_a_broken_off_demo_is_never_taken_for_the_demos_own(tmp_path):
    broken_off(tmp_path / "demo")
    (tmp_path / "demo" / "notes.txt").write_text("mine")
    run(tmp_path / "demo", "second")
    run(tmp_path / "demo", "third")
    assert (tmp_path / "demo.old-1" / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("failures", range(TRIES + 1))
def test_a_flight_whose_link_dies_is_started_again_a_few_times(failures, capsys):
    tries = []

    def flight() -> str:
        tries.append(None)
        if len(tries) <= failures:
            raise LinkError("no vehicle answers")
        return "log"

    if failures == TRIES:
        with pytest.raises(LinkError, match="no vehicle answers"):
            again_if_link_dies(flight, "flight walk")
        assert len(tries) == TRIES
    else:
        assert again_if_link_dies(flight, "flight walk") == "log"
        assert capsys.readouterr().err.count("starting it again") == failures


def test_a_demo_that_was_broken_off_in_its_first_step_leaves_nothing_beside(tmp_path):
    def demo() -> None:
        with demo_folder.making(tmp_path / "demo", SETTINGS):
            (tmp_path / "demo" / "half").write_text("of a map")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        demo()
    run(tmp_path / "demo", "second")
    assert names(tmp_path) == ["demo"]
