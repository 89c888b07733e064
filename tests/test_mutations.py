"""The list of faults fits the tree: each can be made, is a fault of Python that still parses, and names its tests."""

import ast
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[1]


def load() -> ModuleType:
    spec = importlib.util.spec_from_file_location("goshawk_mutate", ROOT / "tools" / "mutate.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look there for their own module
    spec.loader.exec_module(module)
    return module


mutate = load()
MUTATIONS = mutate.mutations()


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda m: f"{m.file}: {m.fault}")
def test_every_listed_fault_can_be_made(mutation):
    assert mutate.stale(mutation) == ""
    ast.parse((ROOT / mutation.file).read_text().replace(mutation.text, mutation.replacement))


def test_every_room_has_faults_and_there_are_fifty():
    rooms = {"flight", "esdf", "vehicle", "planner", "sysid", "firmware_bridge", "mapping", "gcs_web", "goshawk"}
    rooms |= {"preflight"}
    assert {mutation.file.partition("/")[0] for mutation in MUTATIONS} == rooms
    assert len(MUTATIONS) >= 50
    assert len({(m.file, m.text, m.replacement) for m in MUTATIONS}) == len(MUTATIONS)


def test_a_fault_fails_its_test_and_never_reaches_the_disk():
    (chosen,) = [m for m in MUTATIONS if m.fault == "unknown clearance is drawn as plenty"]
    before = (ROOT / chosen.file).read_bytes()
    name = f"{chosen.tests[0]}::test_unknown_clearance_is_drawn_as_the_worst"
    assert mutate.run([name])[0] == 0
    assert mutate.run([name], chosen)[0] == 1
    assert (ROOT / chosen.file).read_bytes() == before
