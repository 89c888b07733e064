"""The map: what is shown of it, measuring, and its edits."""

from esdf import Edit
from gcs_web.desk import Desk
from gcs_web.document import map_edits
from gcs_web.panels.document import edit as edit_document
from gcs_web.panels.handlers import Handlers
from gcs_web.protocol.map import AddMapEdit, ChangeMapEdit, DropMapEdits, Measure, Paint, PreviewMapEdit, ShowMap
from gcs_web.protocol.people import Person


def _show(desk: Desk, person: Person, show: ShowMap) -> None:
    desk.map.show(show.slice, show.layers, person.id)


def _measure(desk: Desk, _: Person, measure: Measure) -> None:
    desk.map.measure(active=measure.active)


def _paint(desk: Desk, person: Person, wanted: Paint) -> None:
    desk.map.paint(wanted, person)


def _preview(desk: Desk, person: Person, wanted: PreviewMapEdit) -> None:
    desk.map.preview(wanted, person)


def _edit(
    desk: Desk,
    person: Person,
    edit: AddMapEdit | ChangeMapEdit | DropMapEdits,
) -> None:
    """Take over what `goshawk map edit` wrote first: this change writes the same file."""
    desk.session.take_files()
    if not isinstance(edit, DropMapEdits) and edit.shape is not None:
        desk.map.require_possible(Edit("add", map_edits.solid(edit.shape)))
    edit_document(desk, person, edit)
    desk.map.end_preview(person.id)


HANDLERS: Handlers = {
    ShowMap: _show,
    Measure: _measure,
    Paint: _paint,
    PreviewMapEdit: _preview,
    AddMapEdit: _edit,
    ChangeMapEdit: _edit,
    DropMapEdits: _edit,
}
