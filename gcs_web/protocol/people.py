"""Who has the page open, and what everybody is told."""

from typing import Literal

import msgspec

from gcs_web.protocol.base import Command, Message, State

PROTOCOL = 10
"""Raised when an old page could misread a new server."""


class Person(msgspec.Struct, frozen=True):
    """Someone who has the page open."""

    id: str
    name: str
    here: bool = False
    """Whether on the station's own machine."""


class Welcome(Message, frozen=True, tag="welcome"):
    """First message on every connection."""

    protocol: int
    you: str
    """Id of this person."""
    project: str
    station: str
    """Of the open project; another one after another project was opened: what the page shows is then of the old one."""


class People(State, frozen=True, tag="people"):
    people: list[Person]
    in_control: str
    """Id of the person whose orders the station passes on; empty for nobody."""


class Invitation(msgspec.Struct, frozen=True):
    """An address that lets one more browser in, once; it ends when whoever shows it no longer does."""

    address: str
    code: list[str]
    """Rows of its QR code from the top, "1" for each dark module, without the white round it."""
    only_here: bool
    """Whether it opens on the station's own machine only."""
    good_s: float
    """For so long."""


class Invite(Command, frozen=True, tag="invite", kw_only=True):
    """Ask for an address for another device; the reply has `invitation`."""


class EndInvitation(Command, frozen=True, tag="end_invitation", kw_only=True):
    """The address lets nobody in any more."""


class InvitationEnded(State, frozen=True, tag="invitation_ended"):
    """Used up, or no longer shown: a page that still shows it asks for another one."""

    number: int
    """Of those before."""


Level = Literal["fact", "caution", "danger"]


class Notice(Message, frozen=True, tag="notice"):
    """One line at the foot of the page; stays until the next."""

    text: str
    level: Level = "fact"
    undo: bool = False
    """Whether undo takes back what it tells."""
