"""What `goshawk doctor --out` writes may be attached to a public issue."""

import getpass
import socket
from pathlib import Path

import pytest

from goshawk.cli import main
from goshawk.commands.project.doctor import Finding, report, without_personal_data


@pytest.fixture
def person(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "home", lambda: Path("/home/ada"))
    monkeypatch.setattr(getpass, "getuser", lambda: "ada")
    monkeypatch.setattr(socket, "gethostname", lambda: "engine-2")


@pytest.mark.parametrize(
    ("said", "written"),
    [
        ("vehicle is also in /home/ada/lib/vehicle", "vehicle is also in ~/lib/vehicle"),
        ("/home/ada", "~"),
        ("/home/adam/lib", "/home/adam/lib"),
        ("/mnt/ada/lib", "/mnt/USER/lib"),
        ("no route to engine-2", "no route to HOST"),
        ("engine-20, canada", "engine-20, canada"),
    ],
)
def test_names_of_home_user_and_machine_are_left_out(person, said: str, written: str):
    assert without_personal_data(said) == written


def test_a_user_without_a_name_is_no_error(person, monkeypatch: pytest.MonkeyPatch):
    def nameless() -> str:
        raise KeyError("getpwuid(): uid not found: 4711")

    monkeypatch.setattr(getpass, "getuser", nameless)
    assert without_personal_data("/mnt/ada") == "/mnt/ada"


def test_every_finding_is_a_line_with_its_state():
    lines = report([Finding("numpy", True, "2.0"), Finding("ompl", False, "no such file")]).splitlines()
    assert lines[0].startswith("Goshawk ")
    assert lines[1:] == ["numpy: ok, 2.0", "ompl: NOT OK, no such file"]


def test_the_report_is_written_once_unless_told_otherwise(tmp_path, capsys: pytest.CaptureFixture[str]):
    file = tmp_path / "doctor.txt"
    for arguments, code in ((["--quiet"], 0), ([], 2), (["--overwrite"], 0)):
        with pytest.raises(SystemExit) as ended:
            main(["doctor", "--out", str(file), *arguments])
        assert ended.value.code == code
    assert "numpy: ok" in file.read_text()
    assert "doctor.txt" in capsys.readouterr().err
