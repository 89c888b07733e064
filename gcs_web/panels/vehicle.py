"""Orders to the vehicle. All but Abort and Kill need control and a nonce, and all are written into the audit log."""

import threading
from dataclasses import replace
from datetime import UTC, datetime

import vehicle
from firmware_bridge.dialect.generated.messages import Command
from flight import FlightError, FlightLog, InputError, TrajectoryFile, flight_log, results
from gcs_web.desk import Desk
from gcs_web.panels.handlers import Handlers
from gcs_web.planning import page_values, preflown
from gcs_web.protocol.people import Person
from gcs_web.protocol.reply import Reply
from gcs_web.protocol.vehicle import (
    Abort,
    Connect,
    GiveUpControl,
    Kill,
    LookAtVehicle,
    LookForVehicles,
    Order,
    PrepareOrder,
    PrepareUpload,
    TakeControl,
    Upload,
)
from gcs_web.protocol.wording import for_page

_COMMANDS = {
    "pause": Command.PAUSE,
    "resume": Command.RESUME,
    "land": Command.LAND,
    "disarm": Command.DISARM,
}


def _connect(desk: Desk, person: Person, wanted: Connect) -> None:
    desk.connect(wanted.url.strip(), person, wanted.poses.strip())


def _look(desk: Desk, _: Person, asked: LookForVehicles) -> Reply:
    return Reply(asked.serial, vehicles=desk.find_vehicles())


def _look_at(desk: Desk, person: Person, _: LookAtVehicle) -> None:
    desk.control.required(person).look_again()


def _take_control(desk: Desk, person: Person, take: TakeControl) -> None:
    desk.control.take(person, force=take.force)


def _give_up_control(desk: Desk, person: Person, _: GiveUpControl) -> None:
    desk.control.give_up(person)


def _prepare_upload(desk: Desk, person: Person, prepare: PrepareUpload) -> Reply:
    watch = desk.control.required(person)
    here = watch.planned(desk.checked(), desk.name)
    there = watch.held()
    return Reply(prepare.serial, nonce=desk.control.new_nonce(person, here.crc32), here=here, there=there)


def _upload(desk: Desk, person: Person, upload: Upload) -> None:
    def send() -> None:
        watch, name, file = desk.control.required(person), desk.name, desk.checked()
        desk.control.use_nonce(upload.nonce, person, watch.planned(file, name).crc32)
        hashes = {
            "map_hash": desk.parts.map(desk.inputs).hash,
            "vehicle_hash": vehicle.vehicle_hash(desk.parts.vehicle(desk.inputs)),
        }
        desk.notice(watch.upload(file, name, **hashes))

    desk.control.audited(person, "upload", send, desk.about())


def _prepare_order(desk: Desk, person: Person, prepare: PrepareOrder) -> Reply:
    desk.control.required(person)
    return Reply(prepare.serial, nonce=desk.control.new_nonce(person, "order"))


def _order(desk: Desk, person: Person, order: Order) -> None:
    def give() -> None:
        watch = desk.control.required(person)
        desk.control.use_nonce(order.nonce, person, "order")
        if order.order == "start":
            _start(desk, person, order.crc32)
        elif order.order == "arm":
            if (file := _on_the_table(desk)) is not None:
                _require_no_no_go(desk, file)
            watch.require_fit()
            watch.order(Command.ARM)
        else:
            watch.order(_COMMANDS[order.order])

    about = desk.about() | (_flown_so(desk) if order.order in ("arm", "start") else {})
    desk.control.audited(person, order.order, give, about)


def _start(desk: Desk, person: Person, shown_crc32: str) -> None:
    """Fly what the vehicle holds, if it is the checked plan; the log is saved when it has landed."""
    watch = desk.control.required(person)
    aborted = watch.begin_flight()
    try:
        name, file = desk.name, desk.checked()
        _require_no_no_go(desk, file)
        watch.require_held(file, name)
        if watch.state().foreign is not None:
            _require_shown(replace(file, name=name), shown_crc32)
        watch.require_fit()
        desk.control.required(person)  # reading back takes a while, and a simulated flight may have ended meanwhile
        _require_no_no_go(desk, file)
    except BaseException:
        watch.end_flight()
        raise

    def save(log: FlightLog) -> None:
        path = desk.project.flight(f"{name}-{datetime.now(UTC):%Y%m%d-%H%M%S}")
        with results.new_file(path, overwrite=False) as placing:
            flight_log.save(placing.temporary, log)
        how = "Ended early" if "ended_early" in log.metadata else "Landed"
        desk.notice(f"{how}; the log is saved as {path.relative_to(desk.project.folder)}.")

    def fly() -> None:
        try:
            save(watch.fly(replace(file, name=name), aborted, save))
            desk.control.audit(person, "flight", "landed", desk.about())
        except (FlightError, OSError) as error:
            desk.notice(f"The flight ended early: {for_page(str(error))}", level="danger")
            desk.control.audit(person, "flight", f"ended early: {error}", desk.about())
        finally:
            watch.end_flight()
            desk.show_files()

    threading.Thread(target=fly, name="flight", daemon=True).start()


def _on_the_table(desk: Desk) -> TrajectoryFile | None:
    """The checked plan; None where there is none, which keeps nobody from arming."""
    try:
        return desk.checked()
    except InputError:
        return None


def _require_no_no_go(desk: Desk, file: TrajectoryFile) -> None:
    """A plan whose own preflight is a no-go is not flown; one that was not flown in simulation may be."""
    found = preflown.of(desk.project.folder, file)
    if found.state == "current" and found.verdict == "no_go":
        remedy = f" {found.remedy[0].upper()}{found.remedy[1:]}." if found.remedy else ""
        raise InputError(
            f"not armed. preflight: no-go. {found.sentence}{remedy} Change the plan, or fly its preflight again, in "
            "another wind or with a larger risk accepted"
        )


def _flown_so(desk: Desk) -> dict[str, object]:
    """What simulation said of the plan that an order is about, for the audit log."""
    if (file := _on_the_table(desk)) is None:
        return {}
    found = preflown.of(desk.project.folder, file)
    said = {"state": found.state}
    if found.state == "current":
        said |= {"verdict": found.verdict, "sentence": found.sentence}
    return {"preflight": said}


def _require_shown(file: TrajectoryFile, crc32: str) -> None:
    """The vehicle holds no plan that could be compared: it flies the one that the person saw."""
    if page_values.crc32(file) != crc32:
        raise InputError("the plan is another one than the page showed; look at it again, then start")


def _kill(desk: Desk, person: Person, _: Kill) -> None:
    watch = desk.watch
    if watch is None:
        raise InputError("no vehicle is connected; there is nothing to kill")
    desk.control.audited(person, "kill", watch.kill, desk.about())
    desk.notice(f"{person.name} stopped the rotors", level="danger")


def _abort(desk: Desk, person: Person, _: Abort) -> None:
    watch = desk.watch
    if watch is None:
        raise InputError("no vehicle is connected; there is nothing to abort")
    desk.control.audited(person, "abort", watch.land, desk.about())
    desk.notice(f"{person.name} aborted: the vehicle brakes and lands", level="danger")


HANDLERS: Handlers = {
    Connect: _connect,
    LookForVehicles: _look,
    LookAtVehicle: _look_at,
    TakeControl: _take_control,
    GiveUpControl: _give_up_control,
    PrepareUpload: _prepare_upload,
    Upload: _upload,
    PrepareOrder: _prepare_order,
    Order: _order,
    Abort: _abort,
    Kill: _kill,
}
