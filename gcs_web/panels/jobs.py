"""Background work: start, cancel, forget."""

from collections.abc import Callable
from typing import Any

from gcs_web import protocol
from gcs_web.desk import Desk


def _start(desk: Desk, person: protocol.Person, wanted: protocol.StartJob) -> None:
    desk.jobs.start(wanted.kind, wanted.arguments, person.name)


def _foresee(desk: Desk, _: protocol.Person, wanted: protocol.ForeseeJob) -> protocol.Reply:
    return protocol.Reply(wanted.serial, words=desk.jobs.foresee(wanted.kind, wanted.arguments))


def _cancel(desk: Desk, _: protocol.Person, unwanted: protocol.CancelJob) -> None:
    desk.jobs.cancel(unwanted.job)


def _forget(desk: Desk, _: protocol.Person, ended: protocol.ForgetJob) -> None:
    desk.jobs.forget(ended.job)


def _list(desk: Desk, _: protocol.Person, __: protocol.ListJobs) -> None:
    desk.jobs.look()
    desk.show_jobs()


HANDLERS: dict[type, Callable[[Desk, protocol.Person, Any], protocol.Reply | None]] = {
    protocol.StartJob: _start,
    protocol.ForeseeJob: _foresee,
    protocol.CancelJob: _cancel,
    protocol.ForgetJob: _forget,
    protocol.ListJobs: _list,
}
