"""What every command of the page is made of; see `gcs_web.protocol`."""

import msgspec


class Command(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What every command carries."""

    serial: int
    """Comes back in the reply."""


class Edit(Command, frozen=True, kw_only=True):
    """A change of the document."""

    revision: int
    """What the page showed when the change was made; it is merged if later changes did not touch the same waypoints."""
