"""Changes of the document: edits, undo and redo."""

from collections.abc import Callable
from typing import Any

import msgspec

from gcs_web import protocol
from gcs_web.desk import Desk


def edit(desk: Desk, person: protocol.Person, change: protocol.Edit) -> None:
    """Make a change of the document and say what was done."""
    done = desk.session.edit(change, person.name)
    if done:
        desk.notice(f"{done[0].upper()}{done[1:]}.", undo=True)


def _set_ground(desk: Desk, person: protocol.Person, change: protocol.SetGround) -> None:
    """Where no height is given and none was before: the floor below the waypoint."""
    points, old = desk.session.content.points, getattr(desk.session.content.settings, change.end)
    if points and old is None and change.z_m is None:
        x, y, z = points[0 if change.end == "take_off" else -1].position_world_m
        x, y = x if change.x_m is None else change.x_m, y if change.y_m is None else change.y_m
        change = msgspec.structs.replace(change, z_m=desk.standing_height_m(x, y, z))
    edit(desk, person, change)


def _undo(desk: Desk, person: protocol.Person, _: protocol.Undo) -> None:
    done = desk.session.undo(person.name)
    desk.notice(f"{done[0].upper()}{done[1:]}.")


def _redo(desk: Desk, person: protocol.Person, _: protocol.Redo) -> None:
    done = desk.session.redo(person.name)
    desk.notice(f"{done[0].upper()}{done[1:]}.", undo=True)


HANDLERS: dict[type, Callable[[Desk, protocol.Person, Any], None]] = {
    protocol.Move: edit,
    protocol.Shift: edit,
    protocol.Turn: edit,
    protocol.Insert: edit,
    protocol.Delete: edit,
    protocol.Reverse: edit,
    protocol.Choose: edit,
    protocol.Ask: edit,
    protocol.Pass: edit,
    protocol.Loop: edit,
    protocol.SetGround: _set_ground,
    protocol.ClearGround: edit,
    protocol.SetGate: edit,
    protocol.ClearGate: edit,
    protocol.SetTube: edit,
    protocol.Undo: _undo,
    protocol.Redo: _redo,
}
