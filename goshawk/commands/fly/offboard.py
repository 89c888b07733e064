"""A plan on a flight controller of other firmware: what of the vehicle file that takes, the checks, and a rehearsal."""

import contextlib
import shutil
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np

import vehicle
from firmware_bridge import controller
from firmware_bridge.arming import ArmingCheck, required
from firmware_bridge.betaflight_sitl.body import ADDRESS, SETTINGS, Body, GivenUpError
from firmware_bridge.offboard import byte_line, checks, settings
from firmware_bridge.offboard.guard_process import GuardProcess
from firmware_bridge.offboard.messages import Setup
from firmware_bridge.offboard.poses import Poses, tum_line
from firmware_bridge.offboard.procedure import Flight
from firmware_bridge.offboard.rate_profile import RateProfile
from firmware_bridge.offboard.thrust_map import ThrustMap, through
from firmware_bridge.offboard.tracker import Tracker
from flight import FlightLog, InputError, LinkError, Progress, Trajectory, TrajectoryFile
from goshawk.commands.fly import many_rotors
from goshawk.terminal import console, outputs
from vehicle import Vehicle
from vehicle.forces import open_air

IDLE = 0.055
"""Betaflight's output at no throttle, unless `motor_idle` says otherwise."""
RATE_SHARE, FORCE_SHARE = 0.8, 0.9
"""Of what the firmware and the rotors give; the rest is for what disturbs."""
FAILSAFE_SHARES = 0.9, 0.98
"""Of the weight, while the firmware lands by itself: some 3.7 to .6 m/s."""
QUADX = ((-1, -1), (1, -1), (-1, 1), (1, 1))
"""Signs of x and y of motors 1 to 4."""
QUADX_SPIN = (-1.0, 1.0, 1.0, -1.0)
PATIENCE_S = 600.0
NewTracker = Callable[[controller.Configuration, Poses], Tracker]
RESTART_S = 3.0
"""A flight controller that leaves its command line starts anew; what waits for it after that waits by itself."""
SAG = "battery_sag"
NO_SAG = "battery_sag is not rehearsed: the simulated firmware measures no voltage, so the battery stays at reference_v"
BLACKBOX = "set blackbox_device = VIRTUAL"
"""The simulator's firmware writes its log into its folder."""
RECORDED = ("poses.tum", "blackbox.bfl")
_SAMPLES_1_S = 100.0
_LAST_WORD_S = 3.0
"""For the body to say why it ended, where the flight only knows that its other side is gone."""


@dataclass(frozen=True, slots=True)
class Where:
    """What is flown on."""

    address: str
    pose_host: str
    pose_port: int
    pose_delay_s: float
    clock_port: int = 0


def pose_address(url: str) -> tuple[str, int, float]:
    """Host, port and delay of `udp://HOST:PORT?delay=SECONDS`.

    Raises:
        InputError: it is none.
    """
    parts = urlsplit(url)
    try:
        delay_s = float(parts.query.removeprefix("delay=") or 0.0)
        if parts.scheme != "udp" or not parts.hostname or parts.port is None or not 0.0 <= delay_s <= 0.2:
            raise ValueError
    except ValueError:
        raise InputError(
            f"--pose-stream {url} is not udp://HOST:PORT, with ?delay=SECONDS of at most 0.2 where needed"
        ) from None
    return parts.hostname, parts.port, delay_s


def rotor_of_motor(model: Vehicle) -> tuple[int, int, int, int]:
    """Which rotor of the vehicle file each of Betaflight's motors 1 to 4 turns.

    Raises:
        InputError: its rotors are not one a quarter, as QUADX has them.
    """
    quarters = [(int(np.sign(x)), int(np.sign(y))) for x, y, _ in model.hub_body_m]
    try:
        first, second, third, fourth = (quarters.index(place) for place in QUADX)
    except ValueError:
        raise InputError(
            f"{model.name} has no rotor in one of the four quarters; only Betaflight's mixer QUADX is flown"
        ) from None
    return first, second, third, fourth


def motor_of_rotor(model: Vehicle) -> tuple[int, ...]:
    """Which of Betaflight's motors turns each rotor; none of more than four, whose outputs its blackbox has."""
    return tuple(int(i) for i in np.argsort(rotor_of_motor(model))) if model.rotors == 4 else ()


def thrust_map(model: Vehicle, *, idle: float = IDLE) -> ThrustMap:
    """Collective force in air at rest over the throttle, the rotors' speed in proportion to the output.

    A vehicle with the effect `battery_sag` tells how it falls with the battery's voltage.

    Args:
        idle: the firmware's output at no throttle, 0 to 1.
    """
    throttle = np.linspace(0.02, 1.0, 50)
    speed = model.limits.rotor_speed_max_rad_s * (idle + (1.0 - idle) * throttle)
    still = np.zeros((len(throttle), 3))
    speeds, around = np.repeat(speed[:, None], model.rotors, axis=1), open_air(len(speed), model.rotors)
    force, _ = vehicle.wrench(model, still, still, speeds, surroundings=around)
    sags = SAG in model.effects
    sag = {name: model.value(f"{SAG}.{name}") for name in ("reference_v", "sag_per_v")} if sags else {}
    return through(throttle, force[:, 2], **sag)


def failsafe_us(model: Vehicle, profile: RateProfile, thrust: ThrustMap) -> tuple[float, float]:
    """Pulses of the throttle between which the firmware's own landing sinks slowly: inflow bounds it."""
    weight_n = model.mass_kg * model.gravity_m_s2
    least, most = (profile.pulses_us(np.zeros(3), thrust.throttle(share * weight_n))[2] for share in FAILSAFE_SHARES)
    return float(least), float(most)


def require_followable(
    model: Vehicle, trajectory: Trajectory, largest_rad_s: tuple[float, float, float], force_n: tuple[float, float], *,
    remedy: Callable[[int, float], str] = lambda axis, deg_s: f"set {checks.AXES[axis]}_srate = {deg_s / 10.0:.0f}",
    rate_share: float = RATE_SHARE, whose: str = "the firmware's rates allow",
) -> None:  # fmt: skip
    """
    Args:
        largest_rad_s: body rates that the firmware is set up for.
        force_n: the rotors' least and most.
        remedy: what lets it turn at a rate about an axis, in deg/s.
        rate_share: of the largest rates that is used; `whose` they are, in words.

    Raises:
        InputError: the plan asks for more than the firmware's rates or the rotors give; figure and instant.
    """
    times = np.arange(0.0, trajectory.duration_s, 1.0 / _SAMPLES_1_S)
    flat = vehicle.flatness.state(model, trajectory, times)
    for axis, name in enumerate(checks.AXES):
        rate = np.abs(flat.rate_body_rad_s[:, axis])
        worst, bound = int(np.nanargmax(rate)), rate_share * largest_rad_s[axis]
        if rate[worst] > bound:
            deg_s = np.rad2deg(rate[worst])
            raise InputError(
                f"the plan turns at {deg_s:.0f} deg/s about {name} at {times[worst]:.1f} s, {whose} "
                f"{np.rad2deg(bound):.0f} ({rate_share:.0%} of the largest); "
                f"{remedy(axis, 10.0 * np.ceil(deg_s / rate_share / 10.0))}, or plan more slowly"
            )
    least_n, largest_n = force_n
    worst, most_n = int(np.nanargmax(flat.thrust_n)), FORCE_SHARE * largest_n
    if flat.thrust_n[worst] > most_n:
        raise InputError(
            f"the plan takes {flat.thrust_n[worst]:.1f} N at {times[worst]:.1f} s, the rotors give {most_n:.1f} N "
            f"({FORCE_SHARE:.0%} of full throttle); plan more slowly"
        )
    least = int(np.nanargmin(flat.thrust_n))
    if not flat.thrust_n[least] > least_n:
        raise InputError(
            f"the plan takes {flat.thrust_n[least]:.2f} N at {times[least]:.1f} s, less than the {least_n:.2f} N of "
            "idling rotors; plan more slowly"
        )


def fly(
    model: Vehicle, item: TrajectoryFile, where: Where, *, progress: Progress, cancel: Callable[[], bool],
    restarted: Callable[[], object] = lambda: time.sleep(RESTART_S), tracker: NewTracker = Tracker,
    guard: Callable[..., GuardProcess] = GuardProcess,
) -> tuple[FlightLog, str]:  # fmt: skip
    """Read the settings back, check them and the plan, and fly it.

    Args:
        tracker: what follows the plan.
        guard: starts what guards.
        restarted: waits until the firmware has started again after its command line.

    Returns:
        The log, and why the flight ended early: empty if it did not.

    Raises:
        InputError: the plan cannot be followed.
        LinkError: a setting is wrong, nothing answers, or it does not arm.
    """
    found = read(where)
    profile, thrust = _as_set(model, found)
    required(arming_checks(model, found))
    require_followable(model, item.trajectory, profile.largest_rad_s, (thrust.force_n(0.0), thrust.force_n(1.0)))
    configuration = controller.parameters_of(many_rotors.as_four(model))
    arm = checks.arm_mode(found)
    assert arm is not None
    restarted()
    setup = Setup(
        where.address, where.pose_host, where.pose_port, where.pose_delay_s, profile, thrust, model.mass_kg,
        model.gravity_m_s2, checks.by_msp_alone(found), arm.channel, (arm.from_us + arm.to_us) // 2,
        clock_port=where.clock_port,
    )  # fmt: skip
    with guard(setup.to_json()) as guarding:
        flight = Flight(
            guarding, lambda poses: tracker(configuration, poses), item.trajectory, progress=progress, cancel=cancel,
            motor_of_rotor=motor_of_rotor(model),
        )  # fmt: skip
        flight.tracker.thrust_map = thrust
        return flight.fly(), flight.ended_early


def read(where: Where) -> settings.Settings:
    """Its settings, by its command line, after which it starts anew. Raises `LinkError` where nothing answers."""
    line = byte_line.connect(where.address)
    try:
        return settings.read(line)
    finally:
        line.close()


def arming_checks(model: Vehicle, found: settings.Settings) -> tuple[ArmingCheck, ...]:
    """Every condition of its settings, for this vehicle file."""
    profile, thrust = _as_set(model, found)
    hover = checks.hover(thrust.throttle(model.mass_kg * model.gravity_m_s2))
    own = checks.checks(found, failsafe_us=failsafe_us(model, profile, thrust))
    return checks.simulator(found), checks.as_many_rotors(found, model.rotors), hover, *own


def _as_set(model: Vehicle, found: settings.Settings) -> tuple[RateProfile, ThrustMap]:
    idle = found.number("motor_idle", 1e4 * IDLE) / 1e4
    return RateProfile.of_settings(found.values), thrust_map(model, idle=idle)


def body_of(model: Vehicle, trajectory: Trajectory, *, seed: int, believed: Vehicle | None = None) -> Body:
    """The vehicle of a file on the ground below the start, as a body for Betaflight's SITL.

    Its rotors react to being spun up, as every rotor does: without that Betaflight's own yaw loop swings. Its battery
    does not sag: the simulator's firmware measures no voltage, so that nothing could correct the throttle.

    Args:
        believed: the vehicle that the firmware was set up for; None: this one.
    """
    if model.rotors != 4 or model.axis_body is not None:
        raise InputError(
            f"{model.name} has {model.rotors} rotors; Betaflight's simulator drives four of QUADX: no rehearsal"
        )
    motors, set_for = rotor_of_motor(model), believed or model
    sinks_us = failsafe_us(set_for, RateProfile((1.0, 1.0, 1.0)), thrust_map(set_for))
    throttle_us = round(float(np.mean(sinks_us)))
    if SAG in model.effects:
        model = model.without_effect(SAG)
    if "rotor_acceleration_torque" not in model.effects:
        # a propeller and bell of this size: 1e-5 kg m2 at five inches, with the fourth power of the radius
        inertia = 1e-5 * (model.value("rotor_radius_m") / 0.0635) ** 4
        model = model.with_effect("rotor_acceleration_torque", rotor_inertia_kg_m2=inertia)
    spins = [float(model.spin[rotor]) for rotor in motors]
    if spins not in (list(QUADX_SPIN), [-spin for spin in QUADX_SPIN]):
        raise InputError(f"{model.name}: neighbouring rotors do not spin against each other, as QUADX has them")
    reversed_too = () if spins == list(QUADX_SPIN) else ("set yaw_motors_reversed = ON",)
    own = (f"set failsafe_throttle = {throttle_us}", *reversed_too)
    start = trajectory.position([0.0])[0]
    plant = vehicle.simulate.Plant(
        model,
        vehicle.simulate.State(position_world_m=np.array([start[0], start[1], 0.0])),
        rng=np.random.default_rng(seed),
        ground_m=0.0,
    )
    return Body(
        plant, model.limits.rotor_speed_max_rad_s, motors, seed=seed, settings=(*SETTINGS, *own)
    )  # fmt: skip


@contextlib.contextmanager
def rehearsing(body: Body, folder: Path | None = None) -> Iterator[tuple[Where, Callable[[], object]]]:
    """Betaflight's SITL in a body, beside us: where to fly, and what waits for its restart.

    Args:
        folder: where the firmware's files stay; None: nowhere.

    Raises:
        UnavailableError: there is no firmware, and it cannot be built here.
        LinkError: the firmware or the body failed.
    """
    starts, failed = threading.Semaphore(0), list[Exception]()
    body.on_ready = starts.release

    def run() -> None:
        try:
            body.run(folder=folder)
        except Exception as error:
            failed.append(error)
            starts.release()

    def wait() -> None:
        if not starts.acquire(timeout=PATIENCE_S) or failed:
            raise failed[0] if failed else LinkError("Betaflight's SITL does not start")

    thread = threading.Thread(target=run, name="body", daemon=True)
    thread.start()
    wait()
    try:
        yield Where(ADDRESS, "127.0.0.1", 0, 0.0, body.clock_port), wait
    except LinkError as error:
        body.given_up = True
        thread.join(_LAST_WORD_S)
        told = [why for why in failed if not isinstance(why, GivenUpError)]
        raise (told[0] if told else error) from None
    finally:
        body.given_up = True
        thread.join(PATIENCE_S if not failed else 0.0)


def rehearse(
    model: Vehicle, item: TrajectoryFile, *, seed: int, progress: Progress, cancel: Callable[[], bool],
    flies: Vehicle | None = None, record: Path | None = None,
) -> tuple[FlightLog, str, float]:  # fmt: skip
    """`fly` against Betaflight's SITL; also the touch-down speed, m/s.

    Args:
        flies: the vehicle of the body, where it is another than the one believed in.
        record: a folder for what other recorders write beside it, its blackbox and the poses (`recorded`).
    """
    body = body_of(flies or model, item.trajectory, seed=seed, believed=model)
    with contextlib.ExitStack() as stack:
        own = None
        if record is not None:
            own = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            body.settings = (*body.settings, BLACKBOX)
            stack.callback(_recorded, record, own, body)
        where, restarted = stack.enter_context(rehearsing(body, own))
        log, early = fly(model, item, where, progress=progress, cancel=cancel, restarted=restarted)
    told = {"source": "rehearsal on Betaflight's SITL, a simulated body"}
    told |= {"battery": NO_SAG} if SAG in model.effects else {}
    noted = replace(log, metadata={**log.metadata, **told})
    return noted, early, body.fastest_down_m_s


def _recorded(record: Path, firmware: Path, body: Body) -> None:
    """As `recorded`; what cannot be written is said, and the flight's own log is written all the same."""
    try:
        recorded(record, firmware, body)
    except (OSError, InputError) as error:
        console.note(f"{record}: the recordings were not written: {error}")


def recorded(record: Path, firmware: Path, body: Body) -> None:
    """What the simulated tracking system has sent, and the last blackbox, as `RECORDED`; old ones are kept."""
    record.mkdir(parents=True, exist_ok=True)
    with outputs.file(record / RECORDED[0], overwrite=True) as poses:
        poses.write_bytes(b"".join(map(tum_line, body.sent)))
    logs, place = sorted(firmware.glob("LOG*.BF*")), record / RECORDED[1]
    if not logs:
        earlier = f"; {place} is of an earlier flight" if place.exists() else ""
        console.note(f"the firmware wrote no blackbox{earlier}")
        return
    if len(logs) > 1:
        console.note(f"the firmware wrote {len(logs)} blackboxes; {place.name} is the last, since its last restart")
    with outputs.file(place, overwrite=True) as blackbox:
        shutil.copy(logs[-1], blackbox)


def model_of(vehicle_file: Path | None) -> Vehicle:
    """
    Raises:
        InputError: none is given.
    """
    if vehicle_file is None:
        raise InputError("give --vehicle, the file of the vehicle that flies: its mass, rotors and limits are used")
    return vehicle.load(vehicle_file)
