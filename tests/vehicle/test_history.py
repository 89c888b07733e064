"""The history of a vehicle file: every version is kept, and a restored file is byte-equal."""

import json
import os

import pytest

import vehicle
from flight import FormatError, InputError
from vehicle import history

GUARD = """
from vehicle.effects.base import Effect, Spec, Stage

def apply(flow, p):
    flow.force_n[1] -= p.drag_kg_m * flow.velocity_m_s[1]

EFFECT = Effect(name="history_guard", number=0, stage=Stage.FORCE, apply=apply,
    parameters=(Spec("drag_kg_m", "N s/m", prior=0.02, bounds=(0.0, 1.0)),),
    law="F_y = -c v_y", source="here", channel="F_y", regressor="v_y", excited_by=("fast_level",))
"""


@pytest.fixture
def file(tmp_path):
    """A vehicle file with a comment of its owner's, which only a byte-for-byte copy keeps."""
    path = tmp_path / "kestrel.toml"
    vehicle.save(path, vehicle.example().without_effect("rotor_drag_thrust"))
    path.write_text("# weighed twice\n" + path.read_text())
    return path


def add(path, effect, **values):
    return history.record(path, vehicle.load(path).with_effect(effect, **values), "add-effect", effect=effect)


def test_reading_writes_nothing(file):
    assert [step.action for step in history.read(file).steps] == ["start"]
    assert history.version(file, history.read(file).steps[0]).effects == vehicle.load(file).effects
    assert [p.name for p in file.parent.iterdir()] == [file.name]


def test_the_first_version_is_as_old_as_its_file_whenever_one_looks(file):
    os.utime(file, (1e9, 1e9))
    assert history.read(file).steps[0].when_utc == "2001-09-09T01:46:40+00:00"
    add(file, "rotor_drag_thrust")
    assert history.read(file).steps[0].when_utc == "2001-09-09T01:46:40+00:00"


def test_undo_restores_the_exact_file_step_by_step(file):
    first = file.read_bytes()
    add(file, "rotor_drag_thrust", drag_s_m=0.02)
    second = file.read_bytes()
    add(file, "flapping_moment")
    assert history.restore(file)[0].effect == "flapping_moment"
    assert file.read_bytes() == second
    history.restore(file)
    assert file.read_bytes() == first
    with pytest.raises(InputError, match="nothing to undo"):
        history.restore(file)


def test_a_version_with_the_bytes_of_a_later_one_is_still_itself_after_a_return_to_it(file):
    vehicle.save(file, vehicle.load(file))
    add(file, "flapping_moment")
    again = history.record(file, vehicle.load(file).without_effect("flapping_moment"), "remove-effect")
    assert again.file_sha256 == history.read(file).steps[0].file_sha256
    history.restore(file, 0)
    assert history.read(file).current == 0
    with pytest.raises(InputError, match="nothing to undo"):
        history.restore(file)


def test_an_undone_version_can_be_restored(file):
    step = add(file, "rotor_drag_thrust", drag_s_m=0.02)
    data = file.read_bytes()
    history.restore(file)
    add(file, "flapping_moment")
    told = history.read(file)
    assert [s.effect for s in told.line()] == ["", "flapping_moment"]
    assert len(told.steps) == 3
    history.restore(file, step.number)
    assert file.read_bytes() == data
    with pytest.raises(InputError, match="no version 7"):
        history.restore(file, 7)


def test_an_edit_by_hand_is_a_version_too(file):
    add(file, "rotor_drag_thrust")
    before = file.read_bytes()
    edited = before.replace(b"weighed", b"weighed again")
    file.write_bytes(edited)
    add(file, "flapping_moment")
    assert [s.action for s in history.read(file).line()] == ["start", "add-effect", history.EDIT, "add-effect"]
    history.restore(file)
    assert file.read_bytes() == edited
    history.restore(file)
    assert file.read_bytes() == before


def test_an_edit_that_was_never_recorded_can_be_undone_and_returned_to(file):
    add(file, "rotor_drag_thrust")
    edited = file.read_bytes() + b"# a note\n"
    file.write_bytes(edited)
    left, _ = history.restore(file)
    assert left.action == history.EDIT
    history.restore(file, left.number)
    assert file.read_bytes() == edited


def test_effect_files_are_found_from_every_version(file):
    (file.parent / "guard.py").write_text(GUARD)
    history.record(file, vehicle.load(file).with_effect_file(file.parent / "guard.py"), "add-effect", effect="guard")
    guarded = history.read(file).steps[-1]
    history.record(file, vehicle.load(file).without_effect("history_guard"), "remove-effect", effect="history_guard")
    assert vehicle.load(file).effect_files == ()
    assert "history_guard" in history.version(file, guarded).effects


def test_a_step_interrupted_before_the_file_was_written_changes_nothing(file, monkeypatch):
    add(file, "rotor_drag_thrust")
    before = file.read_bytes()
    write = history.file_format.write_bytes

    def interrupted(path, data):
        if path == file:
            raise KeyboardInterrupt
        write(path, data)

    with monkeypatch.context() as patch:
        patch.setattr(history.file_format, "write_bytes", interrupted)
        with pytest.raises(KeyboardInterrupt):
            add(file, "flapping_moment")
    assert file.read_bytes() == before
    assert history.read(file).line()[-1].effect == "rotor_drag_thrust"
    assert [p.name for p in sorted(file.parent.iterdir())] == ["kestrel.history", "kestrel.toml"]


def test_held_out_errors_are_remembered(file):
    found = history.HeldOut({"b.parquet": "ab"}, {"position_m": 0.2}, {"position_m": 0.1}, "helped")
    history.record(file, vehicle.load(file).with_effect("flapping_moment"), "add-effect", held_out=found)
    assert history.read(file).steps[-1].held_out == found


@pytest.mark.parametrize("damage", ["current", "steps", "parent", "snapshot"])
def test_a_damaged_history_is_refused_with_the_reason(file, damage):
    add(file, "rotor_drag_thrust")
    kept = history.folder(file) / "history.json"
    document = json.loads(kept.read_text())
    if damage == "snapshot":
        (history.folder(file) / "0000.toml").write_text("not what it was")
    elif damage == "parent":
        document["steps"][1]["parent"] = 1
    elif damage == "current":
        document["current"] = 9
    else:
        document["steps"] = [{"number": 0}]
    kept.write_text(json.dumps(document))
    before = file.read_bytes()
    with pytest.raises(FormatError):
        history.restore(file)
    assert file.read_bytes() == before


def test_an_unknown_effect_is_refused_with_similar_names():
    with pytest.raises(InputError, match="near it: rotor_drag_thrust, rotor_drag_speed"):
        vehicle.effects.find("rotor_drag")
    with pytest.raises(InputError, match="near it: flapping_moment"):
        vehicle.effects.find("flaping-moment")


def test_another_gravity_is_among_the_differences():
    base = vehicle.example()
    assert history.differences(base, base.with_gravity(9.79)) == ["  gravity_m_s2: 9.80665 -> 9.79 m/s2"]


def test_line_endings_of_an_own_effect_do_not_change_the_vehicle(tmp_path):
    """A copy that a version control system has given other line endings flies the same plans."""
    own = tmp_path / "endings.py"
    hashes = []
    for text in (GUARD, GUARD.replace("\n", "\r\n"), GUARD.replace("-= p", "+= p")):
        own.write_bytes(text.replace("history_guard", "endings_guard").encode())
        hashes.append(vehicle.vehicle_hash(vehicle.example().with_effect_file(own)))
    assert hashes[0] == hashes[1] != hashes[2]
