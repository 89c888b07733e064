"""Changes of the document: edits, undo and redo."""

from collections.abc import Callable
from typing import Any

from gcs_web import protocol
from gcs_web.desk import Desk


def _edit(desk: Desk, person: protocol.Person, edit: protocol.Edit) -> None:
    done = desk.session.edit(edit, person.name)
    if done:
        desk.notice(f"{done[0].upper()}{done[1:]}.", undo=True)


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
    protocol.Undo: _undo,
    protocol.Redo: _redo,
}
