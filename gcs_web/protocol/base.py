"""What every message of the station and every command of a page is made of."""

import msgspec


class Message(msgspec.Struct, frozen=True):
    """What the station tells pages, in the order in which it came up."""


class State(Message, frozen=True):
    """Replaces the message before of its kind: a slow browser, and who comes later, is told the newest only."""


class Command(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What every command carries."""

    serial: int
    """Comes back in the reply."""


class Edit(Command, frozen=True, kw_only=True):
    """A change of the document."""

    revision: int
    """What the page showed when the change was made; it is merged if later changes did not touch the same waypoints."""


class VehicleCommand(Command, frozen=True, kw_only=True):
    """Waits for the vehicle: done beside the others, so that nothing (Abort least of all) waits for it."""


class Question(Command, frozen=True, kw_only=True):
    """Asks for numbers and changes nothing: answered beside the others, so that nothing waits for it."""
