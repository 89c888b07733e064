"""The map: what is shown of it, measuring, and its edits."""

from collections.abc import Callable
from typing import Any

from esdf import Edit
from gcs_web import protocol
from gcs_web.desk import Desk
from gcs_web.document import map_edits
from gcs_web.panels.editing import edit as edit_document


def _show(desk: Desk, person: protocol.Person, show: protocol.ShowMap) -> None:
    desk.map.show(show.slice, show.layers, person.id)


def _measure(desk: Desk, _: protocol.Person, measure: protocol.Measure) -> None:
    desk.map.measure(active=measure.active)


def _paint(desk: Desk, person: protocol.Person, wanted: protocol.Paint) -> None:
    desk.map.paint(wanted, person)


def _preview(desk: Desk, person: protocol.Person, wanted: protocol.PreviewMapEdit) -> None:
    desk.map.preview(wanted, person)


def _edit(
    desk: Desk,
    person: protocol.Person,
    edit: protocol.AddMapEdit | protocol.ChangeMapEdit | protocol.DropMapEdits,
) -> None:
    """Take over what `goshawk map edit` wrote first: this change writes the same file."""
    desk.session.take_files()
    if not isinstance(edit, protocol.DropMapEdits) and edit.shape is not None:
        desk.map.require_possible(Edit("add", map_edits.solid(edit.shape)))
    edit_document(desk, person, edit)
    desk.map.end_preview(person.id)


HANDLERS: dict[type, Callable[[Desk, protocol.Person, Any], None]] = {
    protocol.ShowMap: _show,
    protocol.Measure: _measure,
    protocol.Paint: _paint,
    protocol.PreviewMapEdit: _preview,
    protocol.AddMapEdit: _edit,
    protocol.ChangeMapEdit: _edit,
    protocol.DropMapEdits: _edit,
}
