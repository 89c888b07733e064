"""The link against its bars: uploads over a bad line, log download, hostile traffic, what each frame costs.

    python benchmarks/link.py [--json FILE]

Uploads run over a real UDP socket on loopback against the SITL vehicle; loss, delay and rate are simulated
at the vehicle's end of the line.
"""

import importlib.util
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import report

from firmware_bridge import _controller
from firmware_bridge.dialect.generated import messages as m
from firmware_bridge.impairment import Impairment
from firmware_bridge.link import Link, connect
from firmware_bridge.mavlink import Codec, Signing
from firmware_bridge.sitl_vehicle import SitlVehicle
from flight import Trajectory, TrajectoryFile
from flight.trajectory import fingerprint, sealed

KEY = bytes(range(32))
SEGMENTS = 200
PIECES = SEGMENTS + 3  # opening, segments, check samples, commit
BAD_LINE = Impairment(loss_ratio=0.2, delay_s=0.005, rate_bytes_s=250e3)


class Standing:
    """A plant that stands on the floor: here only the link is measured."""

    time_s = 0.0
    battery_v = 16.0
    position_world_m = velocity_world_m_s = rate_body_rad_s = specific_force_body_m_s2 = np.zeros(3)
    rotor_speed_rad_s = np.zeros(4)
    q_world_body = np.array([1.0, 0.0, 0.0, 0.0])

    def step(self, rotor_speed_command_rad_s: np.ndarray, duration_s: float) -> None:
        self.time_s += duration_s


def plan(coefficients: int, seed: int) -> TrajectoryFile:
    """200 short hops between random points, at rest at each; twelve coefficients an axis, or eight."""
    rng = np.random.default_rng(seed)
    duration_s = 1.5
    pieces = np.zeros((SEGMENTS, 4, coefficients))
    here = np.zeros(4)
    for piece in pieces:
        there = np.append(rng.uniform(-0.5, 0.5, 3), 0.0)
        piece[:, 0] = here
        piece[:, 4:8] = (there - here)[:, None] * np.array([35.0, -84.0, 70.0, -20.0]) / duration_s ** np.arange(4, 8)
        if coefficients == 12:  # a wiggle that vanishes with three derivatives at both ends
            wiggle = np.convolve([0.0, 0.0, 0.0, 0.0, 1.0, -4.0, 6.0, -4.0, 1.0], [1.0, -2.0, 0.5, 1.0])
            piece[:] += 0.1 * wiggle / duration_s ** np.arange(12)
        here = there
    path = Trajectory(np.full(SEGMENTS, duration_s), pieces)
    check = {"passed": True, "trajectory_hash": fingerprint(path)}
    return sealed(TrajectoryFile(path, "bench", "", "", np.zeros((2, 3)), check))


def uploads(line: Impairment, runs: int, rate_bytes_s: float, coefficients: int) -> tuple[np.ndarray, np.ndarray]:
    """Seconds until the commit is confirmed, and datagrams sent for it, of each of several uploads."""
    seconds, datagrams = [], []
    for run in range(runs):
        with (
            SitlVehicle(Standing(), {}, key=KEY, line=line, seed=run) as vehicle,
            connect(vehicle.url, key=KEY) as link,
        ):
            _retry(link.take_control)
            upload = link.upload(plan(coefficients, run), rate_bytes_s=rate_bytes_s)
            seconds.append(upload.duration_s)
            datagrams.append(upload.datagrams)
    return np.array(seconds), np.array(datagrams)


def _retry(step) -> None:
    for _ in range(3):
        try:
            return step()
        except Exception:
            continue
    return step()


def download(line: Impairment) -> float:
    """Seconds to fetch 2000 records (10 s of flight)."""
    with (
        SitlVehicle(Standing(), {}, key=KEY, line=line, log_records=2000) as vehicle,
        connect(vehicle.url, key=KEY) as link,
    ):
        link.take_control()
        link.command(m.Command.LOG_START)
        while vehicle.time_s < 10.5:
            time.sleep(0.1)
        link.command(m.Command.LOG_STOP)
        started_s = time.monotonic()
        log = link.download_log()
        assert len(log) == 2000
        return time.monotonic() - started_s


def telemetry_loss(link: Link, rate_hz: float) -> tuple[float, float]:
    """Share of state messages lost over three seconds, and how many came per second."""
    from firmware_bridge.telemetry_log import lost_ratio

    link.command(m.Command.STATE_RATE, rate_hz)
    with link._port.inbox(m.State) as inbox:
        time.sleep(3.0)
        states = []
        while not inbox.empty():
            states.append(inbox.get())
    span_s = (states[-1].time_us - states[0].time_us) * 1e-6
    return lost_ratio(states), (len(states) - 1) / span_s


def endpoint(codec: Codec) -> _controller.Link:
    """A vehicle that has let this station in and checks as many signatures as it sends."""
    controller = _controller.Controller()
    controller.set_parameters(np.array([row[3] for row in _controller.parameter_table()], dtype=np.float32))
    link = _controller.Link(controller, KEY, 1, 0, 1, 10**9, 0, 5000, 1, 10**6)
    link.receive(codec.encode(m.Heartbeat()), True, 5)
    reader = Codec(250, 1, None)
    while frame := link.transmit(5):
        for received in reader.decode(frame):
            if isinstance(received.message, m.Ping):
                answer = m.Ping(received.message.time_usec, received.message.seq, 1, 1)
                assert link.receive(codec.encode(answer), True, 5) == 1
                assert link.receive(codec.encode(m.LeaseRequest(action=1)), True, 5) == 1
    return link


def costs() -> list[report.Row]:
    """CPU time per frame, at both ends."""
    codec = Codec(255, 190, Signing(KEY))
    segment = m.TrajectorySegment(target_system=1, target_component=1, transfer_id=1, coefficients=(1.5,) * 48)
    vehicle = endpoint(codec)
    frames = [codec.encode(segment) for _ in range(4000)]
    forger = Codec(255, 190, Signing(b"x" * 32))
    forged = [forger.encode(segment) for _ in range(4000)]
    rubbish = np.random.default_rng(0).integers(0, 256, (4000, 240), dtype=np.uint8)
    thrown = [bytes(row) for row in rubbish]

    def receive(datagrams: list[bytes]) -> float:
        started_s = time.process_time()
        for i, datagram in enumerate(datagrams):
            vehicle.receive(datagram, True, 5 + 100 * i)
        return (time.process_time() - started_s) / len(datagrams) * 1e6

    ground = Codec(255, 190, Signing(KEY))
    started_s = time.process_time()
    for frame in frames:
        ground.decode(frame)
    ground_us = (time.process_time() - started_s) / len(frames) * 1e6
    return [
        report.row("signed segment frame, vehicle's C code", receive(frames), "us CPU"),
        report.row("forged segment frame, vehicle's C code", receive(forged), "us CPU"),
        report.row("240 bytes of rubbish, vehicle's C code", receive(thrown), "us CPU"),
        report.row("signed segment frame, ground (Python)", ground_us, "us CPU"),
    ]


def footprint() -> list[report.Row]:
    """Stack, memory and flash of the link on a Cortex-M4F; nothing when the compiler is missing."""
    path = Path(__file__).resolve().parents[1] / "tools" / "assure.py"
    spec = importlib.util.spec_from_file_location("assure", path)
    assert spec is not None
    assert spec.loader is not None
    assure = importlib.util.module_from_spec(spec)
    sys.modules["assure"] = assure
    spec.loader.exec_module(assure)
    try:
        with tempfile.TemporaryDirectory() as folder:
            found = assure.size(Path(folder))
            taken = assure.flash(Path(folder), assure.vehicle_library(Path(folder) / "library"))["controller and link"]
    except assure.MissingToolError as missing:
        print(f"{missing}: the Cortex-M rows are left out")
        return []
    table = []
    for call in ("tc_link_receive", "tc_link_transmit", "tc_link_update", "tc_do"):
        deepest = found.stack[call][0]
        table.append(report.row(f"stack of {call}, bound", deepest, "B", "<= 1024", deepest <= 1024))
    memory = sum(found.ram.values())
    return [
        *table,
        report.row("memory of the link", found.ram["link"], "B"),
        report.row("memory of link and controller besides the slots", memory, "B", "<= 4608", memory <= 4608),
        report.row("flash of link and controller", taken / 1024, "kB", "<= 52", taken <= 52 * 1024),
    ]


def rows() -> list[report.Row]:
    clean_s, clean_n = uploads(Impairment(), 10, 50e6, 12)
    seconds, datagrams = uploads(BAD_LINE, 20, 250e3, 12)
    short_s, short_n = uploads(BAD_LINE, 20, 250e3, 8)
    floor = PIECES / (1.0 - BAD_LINE.loss_ratio)
    name = f"upload of {SEGMENTS} segments, signed"
    bad = "20 % loss each way, 5 ms, 250 kB/s"
    table = [
        report.row(f"{name}, clean line, median", np.median(clean_s) * 1e3, "ms"),
        report.row(f"{name}, clean line, datagrams", np.median(clean_n), "of 203"),
        report.row(f"{name}, {bad}, median", np.median(seconds), "s", "<= 0.36", np.median(seconds) <= 0.36),
        report.row(f"{name}, {bad}, worst of 20", seconds.max(), "s"),
        report.row(
            "datagrams over the floor for that loss, mean",
            datagrams.mean() / floor,
            "ratio",
            "<= 1.06",
            datagrams.mean() / floor <= 1.06,
        ),
        report.row(f"the same, 8 coefficients an axis, {bad}, median", np.median(short_s), "s"),
        report.row("the same, datagrams over the floor, mean", short_n.mean() / floor, "ratio"),
        report.row("10 s of log at 200 Hz, clean line", download(Impairment()), "s"),
        report.row(f"10 s of log at 200 Hz, {bad}", download(BAD_LINE), "s"),
    ]
    with SitlVehicle(Standing(), {}, key=KEY) as vehicle, connect(vehicle.url, key=KEY) as link:
        link.take_control()
        for rate_hz in (100.0, 200.0):
            lost, arrived_hz = telemetry_loss(link, rate_hz)
            table.append(
                report.row(f"telemetry at {rate_hz:g} Hz on loopback, lost", lost * 100, "%", "0", lost <= 0.0)
            )
            table.append(report.row(f"telemetry at {rate_hz:g} Hz, arriving", arrived_hz, "Hz"))
    return table + costs() + footprint()


if __name__ == "__main__":
    report.main(rows)
