"""Messages about the vehicle and the orders to it."""

from typing import Literal

import msgspec

from gcs_web.protocol.base import Command, State, VehicleCommand


class Held(msgspec.Struct, frozen=True):
    """A trajectory as shown before an upload: what the vehicle has, or what it would get."""

    name: str
    duration_s: float
    segments: int
    room_m: float
    """What is left between the vehicle's surface and every obstacle: room for its tracking error."""
    crc32: str


class ArmingCheck(msgspec.Struct, frozen=True):
    """One thing that must hold before the rotors start."""

    name: str
    passed: bool
    finding: str
    remedy: str


class LostLinkAct(msgspec.Struct, frozen=True):
    """Something the vehicle does by itself once the link is lost."""

    after_s: float
    """Of silence; for what follows a hover, without the time that braking takes."""
    act: str


class Failsafe(msgspec.Struct, frozen=True):
    """What happens by itself when something fails, and whose doing it is."""

    whose: str
    when: str
    act: str


class Foreign(msgspec.Struct, frozen=True):
    """Of a vehicle that flies by other firmware than our controller."""

    firmware: str
    failsafes: list[Failsafe]
    can_pause: bool
    kill: str
    """What Kill does to it."""


class Vehicle(State, frozen=True, tag="vehicle"):
    """The vehicle as last heard; sent on every change and at least twice a second."""

    link: Literal["none", "fresh", "stale", "lost"]
    """Stale after 0.5 s, lost after 2 s."""
    name: str = ""
    age_s: float = 0.0
    mission: str = ""
    armed: bool = False
    holds: str = ""
    """Name of the active trajectory."""
    holds_crc32: str = ""
    battery_v: float | None = None
    battery_left_s: float | None = None
    """Until the controller lands by itself, as the voltage falls now; None while that cannot be said."""
    x_m: float | None = None
    y_m: float | None = None
    z_m: float | None = None
    error_m: float | None = None
    """Distance from the set-point now, while a trajectory is flown."""
    room_m: float | None = None
    """What that distance may be before something is touched, as the plan was checked; None where that is not known."""
    speed_m_s: float | None = None
    yaw_rad: float | None = None
    along_s: float | None = None
    """Time along the trajectory, while one is flown."""
    duration_s: float | None = None
    """Of that trajectory, if this station started it."""
    checks: list[ArmingCheck] = []
    """On the ground: all of them must pass before it is armed."""
    largest_error_m: float | None = None
    if_link_lost: list[LostLinkAct] = []
    """In their order; empty on the ground, and where it is not known."""
    reason: str = ""
    """Why the vehicle last changed its state, in its own words."""
    foreign: Foreign | None = None
    """None of one that our controller flies."""


class FoundVehicle(msgspec.Struct, frozen=True):
    """A vehicle that answered when all were asked."""

    url: str
    system: int
    """Its MAVLink system id."""


class LookForVehicles(VehicleCommand, frozen=True, tag="look_for_vehicles", kw_only=True):
    """Ask on this machine and on its networks who is there; the reply has who answered."""


class Connect(VehicleCommand, frozen=True, tag="connect", kw_only=True):
    """Listen to another vehicle, or to none."""

    url: str
    """`udp://host:port`, or `betaflight:`, `mavlink:`, `crazyflie:` and an address; empty for none."""
    poses: str = ""
    """Where the poses of a vehicle of other firmware arrive, which are not in its own messages."""


class LookAtVehicle(VehicleCommand, frozen=True, tag="look_at_vehicle", kw_only=True):
    """Read once more what must hold before a vehicle of other firmware is armed."""


class TakeControl(Command, frozen=True, tag="take_control", kw_only=True):
    """Ask to be the one person whose orders go to the vehicle."""

    force: bool = False
    """Also from someone who has it; they are told."""


class GiveUpControl(Command, frozen=True, tag="give_up_control", kw_only=True):
    pass


class PrepareUpload(VehicleCommand, frozen=True, tag="prepare_upload", kw_only=True):
    """Compare the plan with what the vehicle holds; the reply has both and a nonce that `upload` uses up."""


class Upload(VehicleCommand, frozen=True, tag="upload", kw_only=True):
    nonce: str


class PrepareOrder(Command, frozen=True, tag="prepare_order", kw_only=True):
    """Announce an order; the reply has the nonce that `order` uses up."""


class Order(VehicleCommand, frozen=True, tag="order", kw_only=True):
    order: Literal["arm", "start", "pause", "resume", "land", "disarm"]
    nonce: str
    crc32: str = ""
    """Of the plan that the page shows: a vehicle of other firmware starts that one or none."""


class Abort(VehicleCommand, frozen=True, tag="abort", kw_only=True):
    """Land at once. Needs neither control nor a nonce."""


class Kill(VehicleCommand, frozen=True, tag="kill", kw_only=True):
    """Stop the rotors now, in the air too. Needs neither control nor a nonce; the page asks by a slide."""
