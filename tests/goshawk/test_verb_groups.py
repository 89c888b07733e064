"""The front of the command line: a bare call, a mistyped verb, the version, completion, and the progress line."""

import io
import os
import re
import subprocess
import sys
import time

import pytest
from rich.console import Console

from goshawk.cli import COMMANDS, TASKS, verbs
from goshawk.terminal import progress_line as module
from goshawk.terminal.progress_line import progress_line
from goshawk.terminal.words import named, parameter, with_unit
from tests.goshawk.running import run
from vehicle import effects


def test_a_bare_call_shows_every_verb_once_in_its_group_and_is_no_error():
    said = run()
    for task, summaries in verbs().items():
        assert f"{task}:" in said
        for verb in summaries:
            assert said.count(f"\n  {verb} ") == 1
    assert {task: tuple(summaries) for task, summaries in verbs().items()} == TASKS


def test_every_module_with_a_command_of_its_own_name_is_a_verb():
    own = re.compile(r'^"""`goshawk ([a-z-]+)`:')
    said = {found[1] for path in COMMANDS.glob("*/*.py") if (found := own.match(path.read_text()))}
    assert said == {verb for summaries in verbs().values() for verb in summaries}


@pytest.mark.parametrize("group", ["vehicle", "params"])
def test_a_bare_group_of_verbs_is_no_error_either(group):
    assert f"goshawk {group}" in run(group)


@pytest.mark.parametrize(
    ("typed", "meant"),
    [
        (("identfy",), "identify"), (("ident",), "identify"), (("Map",), "map"), (("nextflight",), "next-flight"),
        (("stil",), "sitl"), (("vehicle", "hsitory"), "history"), (("params", "gte"), "get"),
    ],
)  # fmt: skip
def test_a_mistyped_verb_gets_the_likely_one(typed, meant):
    assert f"did you mean {meant}" in run(*typed, code=2)


def test_a_word_unlike_any_verb_gets_no_suggestion():
    said = run("xyzzy", code=2)
    assert "there is no verb 'xyzzy'" in said
    assert "did you mean" not in said


def test_the_version_is_printed():
    assert run("--version").startswith("goshawk 0.")


def test_the_shell_completes_verbs():
    words = {"COMP_WORDS": "goshawk vehicle sch", "COMP_CWORD": "2", "_GOSHAWK_COMPLETE": "bash_complete"}
    command = [sys.executable, "-c", "from goshawk.cli import main; main()"]
    answer = subprocess.run(command, env=os.environ | words, capture_output=True, text=True, timeout=120, check=False)
    assert "plain,schema" in answer.stdout


def drawn(work, monkeypatch, quiet_s: float) -> str:
    monkeypatch.setattr(module, "QUIET_S", quiet_s)
    screen = io.StringIO()
    with progress_line(Console(file=screen, force_terminal=True, width=100)) as report:
        work(report)
    return screen.getvalue()


def long_work(report):
    for i in range(8):
        report("fitting", i / 8)
        time.sleep(0.15)


def test_long_work_shows_one_line_with_the_time_left(monkeypatch):
    said = drawn(long_work, monkeypatch, quiet_s=0.1)
    assert "fitting" in said
    assert "left" in said
    assert "00:0" in said
    assert "\n\n" not in said.replace("\r", "")


def test_short_work_shows_nothing(monkeypatch):
    assert "fitting" not in drawn(lambda report: report("fitting", 0.5), monkeypatch, quiet_s=2.0)


@pytest.mark.parametrize(
    ("key", "value", "row"),
    [
        ("top_speed_m_s", 4.9, ("top speed", "4.9 m/s")),
        ("duration_s", 5.853, ("duration", "5.853 s")),
        ("waypoints", 4, ("waypoints", 4)),
        ("free space", "3 m3", ("free space", "3 m3")),
        ("rate_hz", None, ("rate", "unknown")),
        ("passed", True, ("passed", True)),
    ],
)
def test_tables_show_display_names_and_units(key, value, row):
    assert with_unit(key, value) == row


def test_parts_of_vectors_are_named_by_vector_and_axis():
    assert named("rate_body_x_rad_s") == ("body rate (gyro), x", "rad/s")
    assert named("battery_v") == ("battery", "V")


def test_parameters_are_called_by_words_without_their_units():
    assert parameter("air_density_kg_m3") == "air density"
    assert parameter("motor_lag.rise_s") == "motor lag: rise"
    units = {"kg", "n", "s", "s2", "m", "m2", "m3", "rad", "hz", "v", "per"}
    for effect in effects.catalogue().values():
        for spec in effect.parameters:
            assert not units & set(parameter(f"{effect.name}.{spec.name}").split(": ")[1].split()), spec.name


@pytest.mark.parametrize("group", ["camera", "map", "log", "vehicle", "params"])
def test_a_groups_help_has_the_whole_sentence_of_each_verb(group):
    assert "..." not in run(group, "--help").split("Commands:")[1]
