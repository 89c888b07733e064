"""Who may come in beside those who are here."""

from gcs_web.desk import Desk
from gcs_web.panels.handlers import Handlers
from gcs_web.protocol.people import Invite, Person
from gcs_web.protocol.reply import Reply


def _invite(desk: Desk, _: Person, wanted: Invite) -> Reply:
    return Reply(wanted.serial, invitation=desk.invitation())


HANDLERS: Handlers = {Invite: _invite}
