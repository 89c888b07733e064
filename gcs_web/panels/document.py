"""Changes of the document: edits, undo and redo."""

import msgspec

from gcs_web.desk import Desk
from gcs_web.panels.handlers import Handlers
from gcs_web.protocol.base import Edit
from gcs_web.protocol.document import (
    Ask,
    Choose,
    ClearGate,
    ClearGround,
    Delete,
    Insert,
    Loop,
    Move,
    Pass,
    Redo,
    Reverse,
    SetGate,
    SetGround,
    SetTube,
    Shift,
    Turn,
    Undo,
)
from gcs_web.protocol.people import Person


def edit(desk: Desk, person: Person, change: Edit) -> None:
    """Make a change of the document and say what was done."""
    done = desk.session.edit(change, person.name)
    if done:
        desk.notice(f"{done[0].upper()}{done[1:]}.", undo=True)


def _set_ground(desk: Desk, person: Person, change: SetGround) -> None:
    """Where no height is given and none was before: the floor below the waypoint."""
    points, old = desk.session.content.points, getattr(desk.session.content.settings, change.end)
    if points and old is None and change.z_m is None:
        x, y, z = points[0 if change.end == "take_off" else -1].position_world_m
        x, y = x if change.x_m is None else change.x_m, y if change.y_m is None else change.y_m
        change = msgspec.structs.replace(change, z_m=desk.standing_height_m(x, y, z))
    edit(desk, person, change)


def _undo(desk: Desk, person: Person, _: Undo) -> None:
    done = desk.session.undo(person.name)
    desk.notice(f"{done[0].upper()}{done[1:]}.")


def _redo(desk: Desk, person: Person, _: Redo) -> None:
    done = desk.session.redo(person.name)
    desk.notice(f"{done[0].upper()}{done[1:]}.", undo=True)


HANDLERS: Handlers = {
    Move: edit,
    Shift: edit,
    Turn: edit,
    Insert: edit,
    Delete: edit,
    Reverse: edit,
    Choose: edit,
    Ask: edit,
    Pass: edit,
    Loop: edit,
    SetGround: _set_ground,
    ClearGround: edit,
    SetGate: edit,
    ClearGate: edit,
    SetTube: edit,
    Undo: _undo,
    Redo: _redo,
}
