"""Give the project a vehicle: of a data sheet, as `goshawk vehicle new` makes it, or one that comes with Goshawk."""

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import msgspec

import vehicle
from flight import InputError, Progress
from flight.project import Project
from gcs_web.desk import Desk
from gcs_web.jobs import incoming
from gcs_web.jobs.jobs import Choices, Kind
from goshawk.commands.learn import vehicle_new
from goshawk.station_jobs.flights import in_words_of
from vehicle import commented, draft, layouts
from vehicle.draft import Known

INCH_M = 0.0254
_NONE = ""
BOXES = {
    "--mass": "Mass",
    "--arm": "Centre to motor",
    "--frame": "Frame",
    "--prop-diameter": "Propeller",
    "--hover-rpm": "Rotor speed in hover",
    "--max-rpm": "Fastest rotor speed",
}
"""Options that the verb's messages name, and what the form has in their place."""


class Arguments(msgspec.Struct, forbid_unknown_fields=True):
    name: Annotated[str, msgspec.Meta(title="Name", max_length=60)] = "my vehicle"
    mass_g: Annotated[
        float,
        msgspec.Meta(title="Mass", description="Ready to fly, battery included", extra_json_schema={"unit": "g"}),
    ] = 0.0
    frame: Annotated[str, msgspec.Meta(title="Frame", description="x: arms to the corners; +: ahead and aside")] = "x"
    arm_mm: Annotated[float, msgspec.Meta(title="Centre to motor", extra_json_schema={"unit": "mm"})] = 0.0
    propeller_in: Annotated[
        float, msgspec.Meta(title="Propeller", description="Diameter", extra_json_schema={"unit": "inch"})
    ] = 0.0
    hover_rpm: Annotated[
        float,
        msgspec.Meta(title="Rotor speed in hover (0: not known)", extra_json_schema={"unit": "1/min"}),
    ] = 0.0
    max_rpm: Annotated[
        float, msgspec.Meta(title="Fastest rotor speed (0: not known)", extra_json_schema={"unit": "1/min"})
    ] = 0.0
    props_out: Annotated[bool, msgspec.Meta(title="Propellers turn outwards in front (props out)")] = False
    source: Annotated[
        str, msgspec.Meta(title="Import from", description="File of PX4, ArduPilot, Betaflight, URDF or MJCF")
    ] = _NONE


class Example(msgspec.Struct, forbid_unknown_fields=True):
    example: Annotated[str, msgspec.Meta(title="Vehicle")]


def _choices(project: Project) -> Choices:
    return {"frame": layouts.FRAMES, "source": [_NONE, *incoming.listed(project, incoming.VEHICLES)]}


def _examples(_: Project) -> Choices:
    return {"example": vehicle.examples()}


def _check(project: Project, asked: Arguments | Example) -> None:
    if isinstance(asked, Arguments) and not asked.source:
        needed = {"Mass": asked.mass_g, "Centre to motor": asked.arm_mm, "Propeller": asked.propeller_in}
        missing = [name for name, value in needed.items() if not value]
        if missing:
            raise InputError(f"{', '.join(missing)}: give what the data sheet says, above 0")
    if project.has_vehicle:
        raise InputError("the project has a vehicle, which is kept; make another project for another one")


@in_words_of(BOXES)
def _run(folder: Path, asked: Arguments, progress: Progress) -> str:
    project = Project(folder, "")
    progress("reading", 0.0)
    known = vehicle_new.imported(incoming.found(project, asked.source)) if asked.source else Known()
    known = vehicle_new.with_options(
        known,
        asked.mass_g / 1000.0 or None,
        asked.arm_mm / 1000.0 or None,
        asked.frame if asked.arm_mm else None,
        asked.propeller_in * INCH_M or None,
        asked.hover_rpm or None,
        asked.max_rpm or None,
    )
    if asked.props_out:
        known = vehicle_new.reversed_spins(known)
    made = draft.draft(replace(known, name=asked.name or known.name or "vehicle"))
    commented.write(project.vehicle, made)
    return made.name


def _run_example(folder: Path, asked: Example, _: Progress) -> str:
    made = vehicle.example(asked.example)
    vehicle.save(Project(folder, "").vehicle, made)
    return made.name


def _done(_: Desk, name: str) -> str:
    return f"{name} is the project's vehicle"


def _written(project: Project, _: Any) -> Path:
    return project.vehicle


KIND = Kind(
    "new_vehicle", "Vehicle from a data sheet", Arguments, _run, _done, _choices, _check, writes=_written
)  # fmt: skip
EXAMPLE = Kind(
    "example_vehicle", "Example vehicle", Example, _run_example, _done, _examples, _check, writes=_written
)  # fmt: skip
