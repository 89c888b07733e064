"""Effect files of the user's own: drafted from a curve; run only after somebody has seen the text and agreed."""

from gcs_web.desk import Desk
from gcs_web.panels.handlers import Handlers
from gcs_web.protocol.consent import AgreeToEffectFile, DraftEffect
from gcs_web.protocol.people import Person
from gcs_web.protocol.reply import Reply


def _agree(desk: Desk, person: Person, wanted: AgreeToEffectFile) -> None:
    def agree() -> None:
        file = desk.consent.agree(wanted.path, wanted.sha256)
        desk.notice(f"{person.name} agreed to run {file.name} (SHA-256 {file.sha256[:12]}).")

    desk.control.audited(person, "run effect file", agree, {"path": wanted.path, "sha256": wanted.sha256})
    desk.vehicle_readable()


def _draft(desk: Desk, person: Person, wanted: DraftEffect) -> Reply:
    file = desk.learning.draft_effect(wanted.name, wanted.form)
    desk.show_learning()
    desk.notice(f"{person.name} drafted {file.relative_to(desk.project.folder.resolve())} from the diagnosis.")
    return Reply(wanted.serial, name=file.name)


HANDLERS: Handlers = {
    AgreeToEffectFile: _agree,
    DraftEffect: _draft,
}
