"""One mission of a batch: what it is planned with, its row of the results, and its trajectory."""

import hashlib
import time
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

import esdf
import mapping
import planner
import vehicle
from flight import FlightError, InfeasibleError, Trajectory, results, trajectory
from flight.mission import KeepIn, Laps, Mission, Yaw
from goshawk.commands.plan import thin_obstacles, waypoints_file
from goshawk.commands.plan.batch_work import Kind, Row
from goshawk.commands.plan.preflown import Again
from mapping.free_space import FreeSpace

COLUMNS: dict[str, type] = {
    "name": str, "status": str, "reason": str, "segments": int, "duration_s": float, "clearance_m": float,
    "top_speed_m_s": float, "could_hide_m": float, "could_hide_share": float,
    "hidden_price_paid_m": float, "method": str,
    "trajectory_hash": str, "cpu_s": float,
}  # fmt: skip
"""Of the tables.

`could_hide_m` is how thick an obstacle could hide near it, None where no image looked, and `could_hide_share` the share
of its length along which more than `mapping.free_space.THRESHOLD_M` could; None where nothing is known of it.
`hidden_price_paid_m` is by how much it counts longer for --hidden-price, None where that was not asked."""
KIND = Kind(
    "goshawk-batch", "missions", "plan", "plans", "planned", "the mission's file", "mission, map, vehicle or options",
    COLUMNS, ("planned",), ("infeasible", "refused"),
    ("could_hide_m", "could_hide_share", "hidden_price_paid_m"),
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Job:
    """All that a worker needs to plan any of the missions."""

    map_folder: Path
    vehicle_file: Path
    options: planner.PlanOptions
    out: Path
    laps: Laps | None = None
    yaw: Yaw | None = None
    keep_in: KeepIn | None = None
    """Asked of every mission, instead of what its file says."""
    thinnest_m: float | None = None
    """Obstacles so thick must not be able to hide within the clearance; None: not asked."""
    again: Again | None = None
    """What a preflight asks for on legs; the margins are in the options."""
    hidden_price: float | None = None
    """Of space where an obstacle could hide, beside that; None: not asked."""
    overwrite: bool = False
    inputs: bytes = b""
    """Hash of map, vehicle and options: a worker that lives on reads changed files again."""

    kind: ClassVar[Kind] = KIND

    def inputs_hash(self) -> bytes:
        return inputs_hash(self)

    def with_inputs(self, inputs: bytes) -> "Job":
        return replace(self, inputs=inputs)

    def into(self, out: Path) -> "Job":
        return replace(self, out=out)

    def absolute(self) -> "Job":
        return replace(self, map_folder=self.map_folder.absolute(), vehicle_file=self.vehicle_file.absolute())

    def shared_files(self) -> str:
        return f"{self.map_folder} or {self.vehicle_file}"

    def key_of(self, item: Path) -> str:
        return key_of(item, self.inputs)

    def missing(self, item: Path) -> Path | None:
        return None if item.is_file() else item

    def work_on(self, item: Path) -> Row:
        return plan_one(item, self)

    def file_of(self, name: str) -> Path:
        return trajectory_path(self.out, name)

    def is_that_of(self, row: Row, path: Path) -> bool:
        """Whether a file holds, unchanged, the trajectory that a row of the journal is about."""
        try:
            item = trajectory.load(path)
        except FlightError:
            return False
        return item.checked and item.as_checked and item.check["trajectory_hash"] == row.get("trajectory_hash")

    def beside(self) -> dict[str, Any]:
        """What the vehicle's model is not for."""
        return {vehicle.purpose.KEY: vehicle.purpose.not_for_design(vehicle.load(self.vehicle_file))}

    def asked(self, mission: Mission) -> Mission:
        """The mission with what is asked of all."""
        asked = replace(
            mission,
            laps=self.laps or mission.laps,
            yaw=self.yaw or mission.yaw,
            keep_in=self.keep_in or mission.keep_in,
        )
        return asked if self.again is None else self.again.of(asked)


def key_of(path: Path, inputs: bytes) -> str:
    """Hash of a mission's file and all other inputs; of those alone for a file that cannot be read."""
    try:
        content = path.read_bytes()
    except OSError:
        content = b""
    return hashlib.sha256(inputs + content).hexdigest()


def inputs_hash(job: Job) -> bytes:
    """Of the map, the vehicle and the options."""
    area = mapping.open_map(job.map_folder)
    drone = vehicle.vehicle_hash(vehicle.load(job.vehicle_file))
    asked = (area.field.hash, drone, job.options, job.laps, job.yaw, job.keep_in)
    asked = asked if job.thinnest_m is None else (*asked, job.thinnest_m)  # else as in journals of earlier versions
    asked = asked if job.again is None else (*asked, job.again)
    asked = asked if job.hidden_price is None else (*asked, "hidden price", job.hidden_price)
    asked = asked if not job.options.local_margins else (*asked, job.options.local_margins)
    return hashlib.sha256(repr(asked).encode()).digest()


def trajectory_path(out: Path, name: str) -> Path:
    """Where a mission's trajectory is written."""
    return out / "trajectories" / f"{name}.json"


def plan_one(path: Path, job: Job) -> Row:
    """Plan one mission and write its trajectory; a mission that fails is a row that says why."""
    began = time.process_time()
    trajectory_path(job.out, path.stem).unlink(missing_ok=True)  # of an earlier run with other inputs
    try:
        asked = waypoints_file.load_mission(path)
        area, drone, free, field = _world(job.map_folder, job.vehicle_file, job.thinnest_m, job.inputs)
        wanted = thin_obstacles.priced(job.options, area, free, job.hidden_price)
        plan = thin_obstacles.plan(job.asked(asked), area, field, drone, wanted, free, job.thinnest_m)
        trajectory_path(job.out, path.stem).parent.mkdir(exist_ok=True)
        with results.new_file(trajectory_path(job.out, path.stem), overwrite=True) as placing:
            planner.save_plan(placing.temporary, plan, name=path.stem)
    except InfeasibleError as error:
        return row_of(path, "infeasible", str(error), cpu_s=time.process_time() - began)
    except FlightError as error:
        return row_of(path, "refused", str(error), cpu_s=time.process_time() - began)
    except Exception as error:  # an error of ours is one mission's, too
        return row_of(path, "failed", f"{type(error).__name__}: {error}", cpu_s=time.process_time() - began)
    hidden = plan.gate.could_hide
    return row_of(
        path,
        "planned",
        "",
        segments=len(plan.trajectory.durations_s),
        duration_s=plan.trajectory.duration_s,
        clearance_m=plan.gate.clearance_m,
        top_speed_m_s=top_speed_m_s(plan.trajectory),
        could_hide_m=None if hidden is None or hidden.unobserved else hidden.thickness_m,
        could_hide_share=None if hidden is None else hidden.length_share,
        hidden_price_paid_m=None if plan.gate.hidden is None else plan.gate.hidden.paid_m,
        method=plan.method,
        trajectory_hash=plan.gate.trajectory_hash,
        cpu_s=time.process_time() - began,
    )


def top_speed_m_s(flown: Trajectory) -> float:
    """Largest speed at samples 10 ms apart."""
    return float(np.linalg.norm(flown.position(flown.sample(0.01), 1), axis=1).max())


def row_of(path: Path, status: str, reason: str, **facts: Any) -> Row:
    return KIND.row(path.stem, status, reason, **facts)


@lru_cache(maxsize=1)
def _world(
    map_folder: Path, vehicle_file: Path, thinnest_m: float | None, _inputs: bytes
) -> tuple[mapping.Map, vehicle.Vehicle, FreeSpace | None, esdf.Field]:
    """Map, vehicle, free space and the field to plan in: read once in each process, and again when the inputs' hash is
    another one."""
    area = mapping.open_map(map_folder)
    free = area.free_space()
    return area, vehicle.load(vehicle_file), free, thin_obstacles.field_to_plan_in(area, free, thinnest_m)
