"""Changes of the document: edits, undo and redo."""

import msgspec

from gcs_web.desk import Desk
from gcs_web.panels.handlers import Handlers
from gcs_web.protocol import document as messages
from gcs_web.protocol.base import Edit
from gcs_web.protocol.people import Person


def edit(desk: Desk, person: Person, change: Edit) -> None:
    """Make a change of the document and say what was done."""
    done = desk.session.edit(change, person.name)
    if done:
        desk.notice(f"{done[0].upper()}{done[1:]}.", undo=True)


def _set_ground(desk: Desk, person: Person, change: messages.SetGround) -> None:
    """Where no height is given and none was before: the floor below the waypoint."""
    points, old = desk.session.content.points, getattr(desk.session.content.settings, change.end)
    if points and old is None and change.z_m is None:
        x, y, z = points[0 if change.end == "take_off" else -1].position_world_m
        x, y = x if change.x_m is None else change.x_m, y if change.y_m is None else change.y_m
        change = msgspec.structs.replace(change, z_m=desk.standing_height_m(x, y, z))
    edit(desk, person, change)


def _undo(desk: Desk, person: Person, _: messages.Undo) -> None:
    done = desk.session.undo(person.name)
    desk.notice(f"{done[0].upper()}{done[1:]}.")


def _redo(desk: Desk, person: Person, _: messages.Redo) -> None:
    done = desk.session.redo(person.name)
    desk.notice(f"{done[0].upper()}{done[1:]}.", undo=True)


HANDLERS: Handlers = {
    messages.Move: edit,
    messages.Shift: edit,
    messages.Turn: edit,
    messages.Insert: edit,
    messages.Delete: edit,
    messages.Reverse: edit,
    messages.Choose: edit,
    messages.Ask: edit,
    messages.Pass: edit,
    messages.Loop: edit,
    messages.SetGround: _set_ground,
    messages.ClearGround: edit,
    messages.SetGate: edit,
    messages.ClearGate: edit,
    messages.SetTube: edit,
    messages.Undo: _undo,
    messages.Redo: _redo,
}
