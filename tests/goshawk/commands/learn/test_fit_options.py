"""The options of a fit are one set for every verb that fits, and errors name no option that a verb does not have."""

import ast
import re
from pathlib import Path
from typing import Any, cast

import click
import pytest

import vehicle
from flight import InputError
from goshawk.cli import goshawk
from goshawk.commands.learn import fit_options
from sysid import HoverCommand, RotorThrust
from sysid.estimator.fit_to_use import Cause
from tests.goshawk.running import run
from tests.goshawk.test_grammar import VERBS

COMMANDS = Path(fit_options.__file__).parent
ROOT = COMMANDS.parents[2]
FITTING = ("identify", "diagnose", "compare")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]*")


def options(verb: str) -> set[str]:
    """Every option of a verb."""
    command = goshawk.get_command(cast("Any", None), verb)
    assert command is not None
    return {"--help"} | {option for p in command.params for option in (*p.opts, *p.secondary_opts)}


def texts(path: Path, kind: type[ast.AST] = ast.Module) -> list[str]:
    """The literal text of each node of a kind; of each error that a module raises, for `ast.Raise`."""
    nodes = [node for node in ast.walk(ast.parse(path.read_text())) if isinstance(node, kind)]
    return [
        " ".join(part.value for part in ast.walk(one) if isinstance(part, ast.Constant) and isinstance(part.value, str))
        for one in nodes
    ]


def test_verbs_that_fit_take_the_same_options_of_a_fit():
    shared = {"--hold", "--free", "--prior", "--split-gaps", "--hold-unidentifiable", "--robust", "--gusts", "--steps"}
    shared |= {"--hover", "--rotor-thrust", "--gravity", "--estimate-command-delay", "--most-nodes"}
    for verb in FITTING:
        assert shared <= options(verb), verb


@pytest.mark.parametrize("verb", FITTING)
def test_errors_name_only_options_that_exist(verb):
    said = texts(COMMANDS / f"{verb}.py", ast.Raise) + texts(Path(fit_options.__file__), ast.Raise)
    named = [option for text in said for option in OPTION.findall(text)]
    assert named
    assert set(named) <= options(verb)


def test_the_library_names_only_options_that_exist():
    """Where a text of the library names a verb with options, as "goshawk identify --add-effect"."""
    found = 0
    for path in (ROOT / "sysid").rglob("*.py"):
        for text in texts(path, ast.JoinedStr) + texts(path, ast.Constant):
            for said in re.findall(r"goshawk ([^`;]*)", text):
                words = said.split()
                verb = next((VERBS[tuple(words[:n])] for n in (3, 2, 1) if tuple(words[:n]) in VERBS), None)
                if verb is not None and OPTION.search(said):
                    assert set(OPTION.findall(said)) <= {name for p in verb.params for name in p.opts}, text
                    found += 1
    assert found


@pytest.mark.parametrize("verb", FITTING)
def test_options_for_the_librarys_arguments_exist(verb):
    assert {flag.split()[0] for flag in fit_options.FLAGS.values()} <= options(verb)


def test_every_argument_that_a_message_of_the_library_names_has_an_option():
    """`gaps='split'` and the like, in any text of the estimator and the logs."""
    sysid = ROOT / "sysid"
    paths = [*sysid.glob("estimator/**/*.py"), *sysid.glob("logs/*.py")]
    said = " ".join(text for path in paths for text in texts(path, ast.Constant))
    arguments = re.findall(r"\b(?:gaps|robust|gusts|unseen|held|free|max_iterations)=[\w']+", said)
    assert set(arguments) <= set(fit_options.FLAGS)
    assert arguments


def test_options_of_a_refit_are_refused_where_nothing_is_refitted(tmp_path):
    path = tmp_path / "v.toml"
    vehicle.save(path, vehicle.example())
    said = run("compare", tmp_path / "a.parquet", "--vehicle", path, "--hold", "inertia_*", "--gusts", "white", code=2)
    assert "only a refit reads --hold and --gusts; give --train FLIGHT too" in said


def test_given_options_are_typed_again():
    found = []

    @click.command()
    @fit_options.fit_options()
    def verb(fit: fit_options.Chosen) -> None:
        found.append(fit_options.typed(fit))

    for line in ([], ["--hold", "a b", "--hold", "c"], ["--split-gaps", "--steps", "5"], ["--refuse-unidentifiable"]):
        verb.main(line, standalone_mode=False)
    assert found == ["", " --hold 'a b' --hold c", " --split-gaps --steps 5", " --refuse-unidentifiable"]


def test_the_next_command_has_what_a_trial_found_in_place_of_what_was_typed():
    assert fit_options.with_cause(" --steps 30 --robust", Cause("", steps=60)) == " --robust --steps 60"
    held = Cause("", held=("inertia_zz_kg_m2",))
    assert fit_options.with_cause(" --gusts white", held) == " --gusts white --hold inertia_zz_kg_m2"
    assert fit_options.with_cause(" --robust", Cause("", without="lap")) == " --robust"


def test_anchors_are_typed_as_numbers_and_a_wrong_one_is_refused_with_an_example():
    fit = dict.fromkeys(fit_options._NAMES, ()) | dict.fromkeys(("most_steps", "most_nodes"), 10_000)
    fit |= {"gusts": "estimate", "hovers": ("0.48", "0.55,0.005@14.2"), "rotor_thrusts": ("0.6,2.0", "0.6,2.0,0.1")}
    anchors = fit_options.read(fit, vehicle.example("hummingbird")).anchors
    assert anchors[:2] == (HoverCommand(0.48), HoverCommand(0.55, 0.005, 14.2))
    assert anchors[2:] == (RotorThrust(0.6, 2.0, 0.06), RotorThrust(0.6, 2.0, 0.1))
    for wrong in ({"hovers": ("half",)}, {"hovers": ("0.5@full",)}, {"rotor_thrusts": ("2.0",)}):
        with pytest.raises(InputError, match="for example"):
            fit_options.read(fit | wrong, vehicle.example("hummingbird"))
