"""A vehicle of any number of rotors as the controller on the ground sees it: collective thrust and body rates alone.

The controller's mixer is for four rotors along body z. Off board its rotor speeds are not used: other firmware mixes.
So r rotors are given as four, each with r / 4 of one's thrust, torque and drag at the same rotor speed.

Left out is what goes by one rotor's radius or place and not by the disk area of all: the effect of the ground, of a
ceiling, and of rotors in each other's wake. The controller compensates none of them, of four rotors neither.
"""

from dataclasses import replace

import numpy as np

from vehicle import Vehicle, draft

PER_ROTOR = (
    "thrust_quadratic", "thrust_affine", "thrust_bem", "thrust_blade_element", "inflow_linear", "translational_lift",
    "rotor_yaw_torque", "torque_affine", "rotor_drag_speed", "flapping_moment", "wake_skew_moment", "gyroscopic_torque",
    "rotor_acceleration_torque",
)  # fmt: skip
"""Effects of which every rotor has its own share."""
UNEVEN = ("weak_rotor", "uneven_rotor_torque")
"""Effects of single rotors; the mean of the first is kept, as less thrust of all."""
LEFT_OUT = ("ground_effect", "ceiling_effect", "rotor_interaction")
"""Four larger rotors would feel them otherwise."""


def as_four(model: Vehicle) -> Vehicle:
    """The vehicle itself if it has four rotors along body z, else four that pull and drag as much together.

    In free air at even rotor speeds, with every effect that the controller compensates.
    """
    if model.rotors == 4 and model.axis_body is None:
        return model
    upright = 1.0 if model.axis_body is None else float(model.axis_body[:, 2].mean())
    scale = 0.25 * model.rotors * upright
    lost = [model.value(f"weak_rotor.loss_{i}") for i in range(model.rotors)] if "weak_rotor" in model.effects else []
    left = 1.0 - float(np.mean(lost)) if lost else 1.0
    parameters = {name: p for name, p in model.parameters.items() if not name.startswith(UNEVEN + LEFT_OUT)}
    for name, p in parameters.items():
        effect = name.partition(".")[0]
        if effect in PER_ROTOR:
            share = scale * (left if effect.startswith("thrust_") else 1.0)
            parameters[name] = replace(p, value=share * p.value, std=share * p.std)
    radius = parameters["rotor_radius_m"]  # the same thrust over disk area: the same inflow
    parameters["rotor_radius_m"] = replace(radius, value=radius.value * float(np.sqrt(scale)))
    arm_m = float(np.hypot(model.hub_body_m[:, 0], model.hub_body_m[:, 1]).mean())
    hubs, spin = draft.layout(arm_m, "x")
    hubs[:, 2] = model.hub_body_m[:, 2].mean()
    effects = tuple(name for name in model.effects if name not in UNEVEN + LEFT_OUT)
    return replace(model, parameters=parameters, hub_body_m=hubs, spin=spin, effects=effects, axis_body=None)
