"""The bin of trajectories that were discarded or replaced."""

from pathlib import Path

from flight import project
from gcs_web.planning import saved


def test_the_bin_is_read_once_and_a_link_that_leads_nowhere_is_passed_over(tmp_path: Path, monkeypatch):
    opened = project.create(tmp_path / "project", "bin")
    folder = opened.folder / "trajectories"
    folder.mkdir(exist_ok=True)
    for number in range(3):
        (folder / f"lap.json.old-{number}").write_text(f"no trajectory {number}")
    (folder / "gone.json.old-1").symlink_to(folder / "nowhere")
    read: list[Path] = []
    load = saved.trajectory.load
    monkeypatch.setattr(saved.trajectory, "load", lambda path: (read.append(path), load(path))[1])
    for _ in range(4):
        assert {each.name for each in saved.aside(opened)} == {"lap"}
    assert len(read) == 3
    (folder / "lap.json.old-0").write_text("another one")
    saved.aside(opened)
    assert len(read) == 4
