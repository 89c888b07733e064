"""The web ground station with many long flights: list, open, pan; time and memory of the station's process.

    python benchmarks/gcs_flights.py [--flights 60] [--samples 1000000] [--json FILE]

The flights are one simulated log of 1 kHz with all standard columns, linked under many names: the station knows flights
by their names, so it reads each for itself. Their cards are made once per log, by a process of its own: of one it is
measured here, and the others' are copies. Opening is what the page does: streams, a first plot of four quantities at
1600 pixels, and the path in the 3D view. No browser takes part, so drawing is not included. CPU times are those of the
station's process, all threads, until the answer is here; wall times, of the machine as busy as it is, stand beside.
"""

import asyncio
import contextlib
import os
import resource
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np
from gcs_station import Page, StationProcess, new_project, page, station_process
from report import Row, main, row

from firmware_bridge.controller import State
from flight import FloatArray, flight_log, project, silent
from gcs_web.flights import reading
from gcs_web.jobs.job_process import JobProcess

STREAMS = ["speed", "error", "position_z", "rate_x"]
PIXELS = 1600
PANS = 200
MOST_MB = 600.0


def circle(samples: int) -> flight_log.FlightLog:
    """Circles of 4 m with noise on all that is measured."""
    rng = np.random.default_rng(0)
    time_s = 1e-3 * np.arange(samples)
    angle = 2.0 * np.pi * time_s / 20.0
    planned = np.stack([4.0 * np.cos(angle), 4.0 * np.sin(angle), 1.5 + 0.5 * np.sin(angle / 7.0)], axis=1)
    velocity = np.gradient(planned, 1e-3, axis=0)
    level = np.tile([1.0, 0.0, 0.0, 0.0], (samples, 1))

    def noisy(value: FloatArray | float, sigma: float, columns: int = 3) -> FloatArray:
        return value + rng.normal(0.0, sigma, (samples, columns))

    vectors = {
        "position_world_m": noisy(planned, 1e-3),
        "velocity_world_m_s": noisy(velocity, 1e-2),
        "q_world_body": level,
        "rate_body_rad_s": noisy(0.0, 0.02),
        "specific_force_body_m_s2": noisy(np.gradient(velocity, 1e-3, axis=0) + np.array([0.0, 0.0, 9.80665]), 0.1),
        "rotor_speed_rad_s": noisy(1500.0, 5.0, 4),
        "rotor_speed_command_rad_s": noisy(1500.0, 5.0, 4),
        "setpoint_position_world_m": planned,
        "setpoint_velocity_world_m_s": velocity,
        "setpoint_q_world_body": level,
    }
    state = np.full(samples, float(State.TRAJECTORY))
    state[: samples // 100] = State.HOLD
    scalars = {"mission_state": state, "battery_v": 16.0 - 1e-3 * time_s}
    return flight_log.from_vectors(time_s, vectors, scalars=scalars, metadata={"trajectory": "circle"})


def prepare(folder: Path, flights: int, samples: int) -> tuple[project.Project, list[str], Row]:
    """A project with so many flights and their cards; what one card takes."""
    opened = new_project(folder)
    names = [f"flight {k:02d}" for k in range(flights)]
    first = opened.flight(names[0])
    first.parent.mkdir(exist_ok=True)
    flight_log.save(first, circle(samples))
    for name in names[1:]:
        os.link(first, opened.flight(name))
    before_s = _children_s()
    JobProcess(reading.write_cards, folder, names[:1], folder / "cards.log").outcome(silent)
    card = reading.card_file(opened, names[0])
    kept = msgspec.json.decode(card.read_bytes(), type=reading.Kept)
    for name in names[1:]:
        renamed = reading.Kept(kept.signature, msgspec.structs.replace(kept.card, name=name))
        reading.card_file(opened, name).write_bytes(msgspec.json.encode(renamed))
    peak_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024e-6
    took = row("card of a flight, once per log", _children_s() - before_s, "CPU s", peers={"peak MB": peak_mb})
    return opened, names, took


def _children_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@dataclass
class Taken:
    wall_s: float = 0.0
    cpu_s: float = 0.0


@contextlib.contextmanager
def taken(station: StationProcess) -> Iterator[Taken]:
    """Filled in when it ends."""
    measured, wall_s, cpu_s = Taken(), time.perf_counter(), station.cpu_s
    yield measured
    measured.wall_s, measured.cpu_s = time.perf_counter() - wall_s, station.cpu_s - cpu_s


async def open_flight(here: Page, name: str) -> tuple[float, float]:
    """What the page asks for when a flight is opened; the stretch it covers, s."""
    flight = (await here.asked("open_flights", flights=[name]))["flights"][0]
    await pan(here, name, flight["start_s"], flight["end_s"])
    await here.asked("show_flights", flights=[name])
    return flight["start_s"], flight["end_s"]


async def pan(here: Page, name: str, from_s: float, to_s: float) -> None:
    answer = await here.asked("read_streams", flight=name, streams=STREAMS, from_s=from_s, to_s=to_s, points=PIXELS)
    assert len(answer["parts"]) == len(STREAMS)


async def talk(station: StationProcess, names: list[str]) -> list[Row]:
    async with page(station.url) as here:
        opening = []
        with taken(station) as listing:
            await here.asked("list_flights")
            await here.until("flights", lambda told: len(told["flights"]) == len(names))
        assert {card["state"] for card in here.state["flights"]["flights"]} == {"ready"}
        for name in names:
            with taken(station) as one:
                start_s, end_s = await open_flight(here, name)
            opening.append(one)
        chance, pans, waits = np.random.default_rng(1), [], []
        for _ in range(PANS):
            span_s = (end_s - start_s) * 10.0 ** chance.uniform(-3.0, 0.0)
            from_s = start_s + chance.uniform(0.0, end_s - start_s - span_s)
            with taken(station) as one:
                await pan(here, names[-1], from_s, from_s + span_s)
            pans.append(1000.0 * one.cpu_s)
            waits.append(1000.0 * one.wall_s)
        list_s, pan_ms = listing.cpu_s, float(np.percentile(pans, 95))
        open_s = max(one.cpu_s for one in opening)
        beside = {"mean": float(np.mean([one.cpu_s for one in opening])), "wall s": max(o.wall_s for o in opening)}
        return [
            row(f"list of {len(names)} flights", list_s, "CPU s", "<= 1", list_s <= 1.0, {"wall s": listing.wall_s}),
            row("a flight opened, worst", open_s, "CPU s", "<= 2", open_s <= 2.0, beside),
            row("pan of four plots, 95 %", pan_ms, "CPU ms", "<= 33", pan_ms <= 33.0,
                {"wall ms": float(np.percentile(waits, 95))}),
            row("the station's memory, peak", station.peak_mb, "MB", f"<= {MOST_MB:g}", station.peak_mb <= MOST_MB),
        ]  # fmt: skip


def rows(flights: int = 60, samples: int = 1_000_000) -> list[Row]:
    with tempfile.TemporaryDirectory() as name:
        opened, names, card = prepare(Path(name) / "project", flights, samples)
        with station_process(opened.folder, triangles=500) as station:
            return [card, *asyncio.run(talk(station, names))]


if __name__ == "__main__":
    main(rows, flights=60, samples=1_000_000)
