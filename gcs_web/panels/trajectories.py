"""Saved trajectories: save, open, compare, discard, restore."""

from dataclasses import replace

from flight import InputError, project, results, trajectory
from gcs_web.desk import Desk
from gcs_web.panels.handlers import Handlers
from gcs_web.planning import saved
from gcs_web.protocol.people import Person
from gcs_web.protocol.plan import PlanAgain
from gcs_web.protocol.reply import Reply
from gcs_web.protocol.trajectories import ComparePlans, Discard, Open, Restore, Save


def _plan_again(desk: Desk, _: Person, __: PlanAgain) -> None:
    desk.request_plan(afresh=True)


def _save(desk: Desk, _: Person, save: Save) -> None:
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


def _open(desk: Desk, person: Person, wanted: Open) -> None:
    name = project.part_name(wanted.name)
    desk.open_saved(replace(trajectory.load(desk.project.trajectory(name)), name=name), person.name)
    said = (
        f"{name} opened as it was saved. An edit plans its waypoints again, without its headings, speeds and requests."
    )
    desk.notice(said, undo=True)


def _discard(desk: Desk, _: Person, unwanted: Discard) -> None:
    name = project.part_name(unwanted.name)
    path = desk.project.trajectory(name)
    if not path.is_file():
        raise InputError(f"there is no trajectory {name} (any more)")
    moved = results.move_aside(path)
    desk.show_files()
    desk.notice(f"{name} discarded; it is kept as {moved.name}, and can be restored from the bin.")


def _restore(desk: Desk, _: Person, wanted: Restore) -> None:
    name = saved.restore(desk.project, wanted.file)
    desk.show_files()
    desk.notice(f"{name} restored.")


_MOST_COMPARED = 2


def _compare(desk: Desk, _: Person, asked: ComparePlans) -> Reply:
    if not 1 <= len(asked.names) <= _MOST_COMPARED:
        raise InputError(f"{len(asked.names)} trajectories cannot be compared; choose two")
    area, believed = desk.parts.map(desk.inputs), desk.parts.vehicle(desk.inputs)
    plans = [saved.summary(desk.trajectory(name), area, believed) for name in asked.names]
    return Reply(asked.serial, plans=plans)


HANDLERS: Handlers = {
    PlanAgain: _plan_again,
    Save: _save,
    Open: _open,
    Discard: _discard,
    Restore: _restore,
    ComparePlans: _compare,
}
