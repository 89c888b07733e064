"""Changes of the document: edits, undo and redo."""

from collections.abc import Callable
from typing import Any

import msgspec

from gcs_web import protocol
from gcs_web.desk import Desk


def _edit(desk: Desk, person: protocol.Person, edit: protocol.Edit) -> None:
    done = desk.session.edit(edit, person.name)
    if done:
        desk.notice(f"{done[0].upper()}{done[1:]}.", undo=True)


def _set_ground(desk: Desk, person: protocol.Person, edit: protocol.SetGround) -> None:
    """Where no height is given and none was before: the floor below the waypoint."""
    points, old = desk.session.content.points, getattr(desk.session.content.settings, edit.end)
    if points and old is None and edit.z_m is None:
        x, y, z = points[0 if edit.end == "take_off" else -1].position_world_m
        x, y = x if edit.x_m is None else edit.x_m, y if edit.y_m is None else edit.y_m
        edit = msgspec.structs.replace(edit, z_m=desk.standing_height_m(x, y, z))
    _edit(desk, person, edit)


def _undo(desk: Desk, person: protocol.Person, _: protocol.Undo) -> None:
    desk.notice(f"{desk.session.undo(person.name).capitalize()}.")


def _redo(desk: Desk, person: protocol.Person, _: protocol.Redo) -> None:
    desk.notice(f"{desk.session.redo(person.name).capitalize()}.", undo=True)


HANDLERS: dict[type, Callable[[Desk, protocol.Person, Any], None]] = {
    protocol.Move: _edit,
    protocol.Shift: _edit,
    protocol.Turn: _edit,
    protocol.Insert: _edit,
    protocol.Delete: _edit,
    protocol.Reverse: _edit,
    protocol.Choose: _edit,
    protocol.Ask: _edit,
    protocol.Pass: _edit,
    protocol.Loop: _edit,
    protocol.SetGround: _set_ground,
    protocol.ClearGround: _edit,
    protocol.SetGate: _edit,
    protocol.ClearGate: _edit,
    protocol.SetTube: _edit,
    protocol.Undo: _undo,
    protocol.Redo: _redo,
}
