"""Saved trajectories: save, open, compare, discard, restore."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from flight import InputError, project, results, trajectory
from gcs_web import protocol
from gcs_web.desk import Desk
from gcs_web.planning import saved


def _plan_again(desk: Desk, _: protocol.Person, __: protocol.PlanAgain) -> None:
    desk.request_plan(afresh=True)


def _save(desk: Desk, _: protocol.Person, save: protocol.Save) -> None:
    name = project.part_name(save.name)
    file = desk.checked()
    path = desk.project.trajectory(name)
    results.require_free(path, overwrite=save.overwrite)
    with results.new_file(path, overwrite=save.overwrite) as placing:
        trajectory.save(placing.temporary, replace(file, name=name))
    desk.rename(name)
    desk.show_files()
    kept = f"; the old one is kept as {placing.kept.name}" if placing.kept else ""
    desk.notice(f"Saved as {path.relative_to(desk.project.folder)}{kept}.")


def _open(desk: Desk, person: protocol.Person, wanted: protocol.Open) -> None:
    name = project.part_name(wanted.name)
    desk.open_saved(replace(trajectory.load(desk.project.trajectory(name)), name=name), person.name)
    said = (
        f"{name} opened as it was saved. An edit plans its waypoints again, without its headings, speeds and requests."
    )
    desk.notice(said, undo=True)


def _discard(desk: Desk, _: protocol.Person, unwanted: protocol.Discard) -> None:
    name = project.part_name(unwanted.name)
    path = desk.project.trajectory(name)
    if not path.is_file():
        raise InputError(f"there is no trajectory {name} (any more)")
    moved = results.move_aside(path)
    desk.show_files()
    desk.notice(f"{name} discarded; it is kept as {moved.name}, and can be restored from the bin.")


def _restore(desk: Desk, _: protocol.Person, wanted: protocol.Restore) -> None:
    name = saved.restore(desk.project, wanted.file)
    desk.show_files()
    desk.notice(f"{name} restored.")


_MOST_COMPARED = 2


def _compare(desk: Desk, _: protocol.Person, asked: protocol.ComparePlans) -> protocol.Reply:
    if not 1 <= len(asked.names) <= _MOST_COMPARED:
        raise InputError(f"{len(asked.names)} trajectories cannot be compared; choose two")
    area, believed = desk.parts.map(desk.inputs), desk.parts.vehicle(desk.inputs)
    plans = [saved.summary(desk.trajectory(name), area, believed) for name in asked.names]
    return protocol.Reply(asked.serial, plans=plans)


HANDLERS: dict[type, Callable[[Desk, protocol.Person, Any], protocol.Reply | None]] = {
    protocol.PlanAgain: _plan_again,
    protocol.Save: _save,
    protocol.Open: _open,
    protocol.Discard: _discard,
    protocol.Restore: _restore,
    protocol.ComparePlans: _compare,
}
