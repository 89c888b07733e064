"""Who may come in beside those who are here."""

from flight import InputError
from gcs_web.desk import Desk
from gcs_web.panels.handlers import Handlers
from gcs_web.protocol.people import EndInvitation, Invite, Person
from gcs_web.protocol.reply import Reply


def _invite(desk: Desk, person: Person, wanted: Invite) -> Reply:
    if not person.here and desk.control.holder != person.id:
        raise InputError("a device is let in by who is in control, or at the station's own machine; take control first")
    invitation, is_new = desk.invitation()
    if is_new:
        desk.control.audit(person, "invite", "shown", {})
        desk.notice(f"{person.name} shows a code that lets a device in.", level="caution")
    return Reply(wanted.serial, invitation=invitation)


def _end(desk: Desk, _: Person, __: EndInvitation) -> None:
    desk.end_invitation()


HANDLERS: Handlers = {Invite: _invite, EndInvitation: _end}
