"""Comparison and model: a residual against a variable, keeping and dropping a tried change, versions of the vehicle."""

from collections.abc import Callable
from typing import Any

from gcs_web import protocol
from gcs_web.desk import Desk


def _scatter(desk: Desk, _: protocol.Person, wanted: protocol.ReadScatter) -> protocol.Reply:
    return protocol.Reply(wanted.serial, scatter=desk.comparing.scatter(wanted.channel, wanted.variable))


def _keep(desk: Desk, person: protocol.Person, wanted: protocol.Keep) -> None:
    step = desk.learning.keep(wanted.vehicle_hash)
    desk.show_learning()
    desk.notice(f"{person.name} kept {step.effect}: the vehicle file is at version {step.number}.")


def _drop(desk: Desk, _: protocol.Person, __: protocol.DropTried) -> None:
    desk.learning.drop()
    desk.show_learning()


def _return_to(desk: Desk, person: protocol.Person, wanted: protocol.ReturnTo) -> None:
    left, now = desk.learning.return_to(wanted.version)
    desk.show_learning()
    desk.notice(f"{person.name} returned the vehicle file from version {left.number} to {now.number}.")


HANDLERS: dict[type, Callable[[Desk, protocol.Person, Any], protocol.Reply | None]] = {
    protocol.ReadScatter: _scatter,
    protocol.Keep: _keep,
    protocol.DropTried: _drop,
    protocol.ReturnTo: _return_to,
}
