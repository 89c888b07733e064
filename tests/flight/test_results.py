"""No result is replaced without `overwrite`, and a replaced one is kept whole beside the new one."""

import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from flight import InputError, results


def write(path: Path, text: str, *, overwrite: bool = False) -> results.Placing:
    with results.new_file(path, overwrite=overwrite) as placing:
        placing.temporary.write_text(text)
    return placing


def fill(path: Path, text: str, *, overwrite: bool = False) -> results.Placing:
    with results.new_folder(path, overwrite=overwrite, ours=lambda folder: (folder / "a.svg").exists()) as placing:
        (placing.temporary / "a.svg").write_text(text)
    return placing


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_an_existing_file_is_refused_before_the_work(tmp_path):
    path = tmp_path / "walk.json"
    results.require_free(path, overwrite=False)
    write(path, "mine")
    with pytest.raises(InputError, match=r"--overwrite.*walk\.json\.old-1"):
        results.require_free(path, overwrite=False)
    results.require_free(path, overwrite=True)


def test_every_replaced_file_is_kept_beside_in_the_order_of_replacing(tmp_path):
    path = tmp_path / "walk.json"
    assert write(path, "first").kept is None
    for text in ("second", "third"):
        write(path, text, overwrite=True)
    assert path.read_text() == "third"
    assert (tmp_path / "walk.json.old-1").read_text() == "first"
    assert (tmp_path / "walk.json.old-2").read_text() == "second"
    assert results.newest_kept(path) == tmp_path / "walk.json.old-2"
    assert names(tmp_path) == ["walk.json", "walk.json.old-1", "walk.json.old-2"]
    assert [p.name for p in tmp_path.glob("*.json")] == ["walk.json"]  # no pattern takes an old one for a result


def test_of_two_writers_the_second_loses_neither_its_own_nor_the_other_ones_result(tmp_path):
    path = tmp_path / "walk.json"

    def overtaken() -> None:
        with results.new_file(path, overwrite=False) as placing:
            placing.temporary.write_text("slow")
            write(path, "fast")

    with pytest.raises(InputError, match=r"walk\.json\.new-1"):
        overtaken()
    assert path.read_text() == "fast"
    assert (tmp_path / "walk.json.new-1").read_text() == "slow"


def test_a_path_that_is_no_regular_file_is_refused_with_its_kind(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    os.mkfifo("pipe")
    with socket.socket(socket.AF_UNIX) as endpoint:
        endpoint.bind("socket")
    Path("link").symlink_to("/dev/full")
    Path("nowhere").symlink_to(tmp_path / "gone")
    Path("circle").symlink_to("circle")
    Path("file").write_text("x")
    refused = {"/dev/full": "device", "link": "device", "pipe": "pipe", "socket": "socket", ".": "folder"}
    refused |= {"nowhere": "does not exist", "circle": "circle", "file/x.json": "not a folder"}
    refused |= {f"{'n' * 250}.json": "File name too long"}
    for path, word in refused.items():
        for overwrite in (False, True):
            with pytest.raises(InputError, match=word):
                results.require_free(Path(path), overwrite=overwrite)
    assert Path("link").is_symlink()


def test_a_link_to_a_file_stays_a_link_and_its_file_is_kept(tmp_path):
    (tmp_path / "real").mkdir()
    write(tmp_path / "real" / "v.toml", "old")
    (tmp_path / "v.toml").symlink_to("real/v.toml")
    write(tmp_path / "v.toml", "new", overwrite=True)
    assert (tmp_path / "v.toml").is_symlink()
    assert (tmp_path / "real" / "v.toml").read_text() == "new"
    assert (tmp_path / "real" / "v.toml.old-1").read_text() == "old"


def test_an_interrupted_result_changes_nothing(tmp_path):
    write(tmp_path / "a.json", "old")
    fill(tmp_path / "figures", "old")

    def interrupted(making) -> None:
        with making as placing:
            if placing.temporary.is_dir():
                (placing.temporary / "a.svg").write_text("half")
            else:
                placing.temporary.write_text("half")
            raise KeyboardInterrupt

    for making in (
        results.new_file(tmp_path / "a.json", overwrite=True),
        results.new_folder(tmp_path / "figures", overwrite=True, ours=lambda _: True),
    ):
        with pytest.raises(KeyboardInterrupt):
            interrupted(making)
    assert names(tmp_path) == ["a.json", "figures"]
    assert (tmp_path / "a.json").read_text() == (tmp_path / "figures" / "a.svg").read_text() == "old"


def test_a_folder_is_replaced_only_when_goshawk_wrote_it(tmp_path):
    fill(tmp_path / "figures", "first")
    assert fill(tmp_path / "figures", "second", overwrite=True).kept == tmp_path / "figures.old-1"
    assert (tmp_path / "figures" / "a.svg").read_text() == "second"
    assert (tmp_path / "figures.old-1" / "a.svg").read_text() == "first"
    thesis = tmp_path / "thesis"
    thesis.mkdir()
    fill(thesis, "into an empty one")
    (thesis / "a.svg").rename(thesis / "chapter.tex")
    for overwrite in (False, True):
        with pytest.raises(InputError, match="not a result"):
            results.require_free_folder(thesis, overwrite=overwrite, ours=lambda folder: (folder / "a.svg").exists())
        with pytest.raises(InputError, match=r"thesis\.new-"):
            fill(thesis, "overtaken", overwrite=overwrite)
    assert names(thesis) == ["chapter.tex"]


def test_two_results_never_share_a_name(tmp_path):
    results.require_apart([tmp_path / "a", None, tmp_path / "b"])
    with pytest.raises(InputError, match="two results"):
        results.require_apart([tmp_path / "a", tmp_path / "x" / ".." / "a"])


def test_without_links_files_are_kept_and_placed_all_the_same(tmp_path, monkeypatch):
    def no_links(*_: object) -> None:
        raise PermissionError

    monkeypatch.setattr(os, "link", no_links)
    write(tmp_path / "a", "old")
    write(tmp_path / "a", "new", overwrite=True)
    assert ((tmp_path / "a").read_text(), (tmp_path / "a.old-1").read_text()) == ("new", "old")


INTO_A_MOUNT = """
import sys
from pathlib import Path
from flight import InputError, results

target, work = Path(sys.argv[1]), Path(sys.argv[2])
results.require_free_folder(target, overwrite=False, ours=lambda _: True)
with results.new_folder(target, overwrite=False, ours=lambda _: True, within=work) as placing:
    (placing.temporary / "part").mkdir()
    (placing.temporary / "part" / "file").write_text("whole")
assert [str(p.relative_to(target)) for p in sorted(target.rglob("*"))] == ["part", "part/file"]
try:
    results.require_free_folder(target, overwrite=True, ours=lambda _: True)
except InputError as error:
    assert "mount point" in str(error)
else:
    raise SystemExit("a filled mount point must be refused before the work")
"""


def test_an_empty_mount_point_takes_a_result_and_a_filled_one_is_refused(tmp_path):
    """A file system of its own, which nothing can be renamed into from beside it."""
    (tmp_path / "disk").mkdir()
    (tmp_path / "work").mkdir()
    mounted = 'mount -t tmpfs none $1 && shift && exec $0 -c "$2" $1 $3'
    words = [sys.executable, tmp_path / "disk", tmp_path / "disk", INTO_A_MOUNT, tmp_path / "work"]
    private = ["unshare", "--mount", "--map-root-user", "sh", "-c"]
    tried = [*private, "mount -t tmpfs none $0", str(tmp_path / "disk")]
    if shutil.which("unshare") is None or subprocess.run(tried, check=False).returncode:
        pytest.skip("this machine lets nobody mount, not even in a namespace of its own")
    ended = subprocess.run([*private, mounted, *map(str, words)], capture_output=True, text=True, check=False)
    assert ended.returncode == 0, ended.stderr
