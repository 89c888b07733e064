"""The generated pages name everything: each verb and option, effect, parameter, finding, reason."""

import re
import subprocess
import sys
from pathlib import Path

import click
import numpy as np
import pytest

import sysid
from firmware_bridge.controller import PARAMETERS, compensated_effects
from flight import FlightLog
from goshawk import cli
from tests.goshawk.test_grammar import VERBS
from tools import reference
from vehicle.effects import catalogue

DOCS = Path(__file__).parents[2] / "docs"


def made(name: str) -> str:
    return reference.MAKERS[name]()


def section(page: str, title: str) -> str:
    return page.split(f"\n### {title}\n")[1].split("\n### ")[0]


def test_every_part_stands_on_one_page_and_nothing_else_is_asked_for():
    texts = [page.read_text() for page in DOCS.rglob("*.md") if "_build" not in page.parts]
    named = [name for text in texts for name in reference.MARK.findall(text)]
    assert sorted(named) == sorted(reference.MAKERS)
    with pytest.raises(KeyError):
        reference.expand("<!-- generated: nothing -->")


def test_every_verb_has_its_section_with_all_its_options():
    page = made("command_line")
    for words, verb in VERBS.items():
        text = section(page, f"goshawk {' '.join(words)}")
        for parameter in verb.params:
            name = parameter.make_metavar(click.Context(verb)) if isinstance(parameter, click.Argument) else ""
            assert (name or parameter.opts[-1]) in text, (words, parameter.opts)


def test_a_verb_answers_h_in_the_process_that_wrote_its_page():
    """Click keeps the help option that a verb makes first, so the page must make the command line's own."""
    page = "from tools.reference import command_line as made; made.page()"
    both = f"{page}; from goshawk.cli import main; main(['init', '-h'])"
    ended = subprocess.run([sys.executable, "-c", both], capture_output=True, text=True, check=False, cwd=DOCS.parent)
    assert ended.returncode == 0, ended.stderr


def test_every_effect_has_its_law_its_parameters_and_what_shows_it():
    page = made("effects")
    for effect in catalogue().values():
        text = section(page, effect.name)
        assert f"\n{effect.law}\n" in text
        assert f"Shows in {effect.channel}" in text.replace("\\", "")
        assert all(f"| `{spec.name}` | {spec.unit} |" in text for spec in effect.parameters)


def test_every_effect_has_one_row_that_says_whether_the_controller_compensates_it():
    rows = re.findall(r"^\| `(\w+)` \| (yes|no) \|", made("compensation"), re.MULTILINE)
    assert rows == [(name, "yes" if entry else "no") for name, entry in compensated_effects().items()]
    assert {name for name, _ in rows} == set(catalogue())


def test_every_parameter_of_the_controller_has_one_row():
    rows = re.findall(r"^\| `(\w+)` \|", made("parameters"), re.MULTILINE)
    assert sorted(rows) == sorted(PARAMETERS)


def test_a_finding_stands_among_the_checks_with_its_sentence_and_its_way_out():
    time_s = np.arange(0.0, 2_000_000.0, 10_000.0)
    log = FlightLog({"time_s": time_s, "position_world_x_m": np.full(len(time_s), np.inf)}, {})
    page = made("log_checks")
    found = sysid.check_log(log).findings
    assert {finding.what for finding in found} >= {"time unit", "infinite"}
    for finding in found:
        shapes = re.findall(rf"^\| {finding.what} \| {finding.level} \| (.*?) \| (.*?) \|", page, re.MULTILINE)
        fits = [
            (sentence, fix)
            for sentence, fix in shapes
            if matches(sentence, finding.sentence) and matches(fix, finding.fix)
        ]
        assert fits, finding


def matches(shape: str, said: str) -> bool:
    pattern = re.escape(shape.replace("\\", "")).replace("…", ".*")
    return re.fullmatch(pattern, said) is not None


def test_the_exit_codes_are_those_that_the_command_line_documents():
    assert re.findall(r"^\| (\d+) \|", made("exit_codes"), re.MULTILINE) == ["0", "1", "2", "130", str(cli.INTERNAL)]


def test_every_reason_of_the_vehicle_is_said_once():
    rows = re.findall(r"^\| (\d+) \| (.+) \|$", made("vehicle_reasons"), re.MULTILINE)
    assert len(rows) > 60
    assert len({number for number, _ in rows}) == len({reason for _, reason in rows}) == len(rows)
