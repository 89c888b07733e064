"""Effect files of the user's own: drafted from a curve; run only after somebody has seen the text and agreed."""

from collections.abc import Callable
from typing import Any

from gcs_web import protocol
from gcs_web.desk import Desk


def _agree(desk: Desk, person: protocol.Person, wanted: protocol.AgreeToEffectFile) -> None:
    def agree() -> None:
        file = desk.consent.agree(wanted.path, wanted.sha256)
        desk.notice(f"{person.name} agreed to run {file.name} (SHA-256 {file.sha256[:12]}).")

    desk.audited(person, "run effect file", agree, {"path": wanted.path, "sha256": wanted.sha256})
    desk.vehicle_readable()


def _draft(desk: Desk, person: protocol.Person, wanted: protocol.DraftEffect) -> protocol.Reply:
    file = desk.learning.draft_effect(wanted.name, wanted.form)
    desk.show_learning()
    desk.notice(f"{person.name} drafted {file.relative_to(desk.project.folder.resolve())} from the curve.")
    return protocol.Reply(wanted.serial, name=file.name)


HANDLERS: dict[type, Callable[[Desk, protocol.Person, Any], protocol.Reply | None]] = {
    protocol.AgreeToEffectFile: _agree,
    protocol.DraftEffect: _draft,
}
