"""What is known of vehicles of any frame (`hex`, `octo`, ...), for `draft.draft`."""

from typing import Any

from vehicle import Parameter, draft
from vehicle.draft import Known


def small(frame: str, **more: Any) -> Known:
    """Arms of 16 cm, 0.9 kg."""
    return _known(frame, 0.16, 0.9, 0.09, more)


def large(frame: str, **more: Any) -> Known:
    """Arms of 28 cm, 1.6 kg."""
    return _known(frame, 0.28, 1.6, 0.115, {"rotor_speed_max_rad_s": 900.0} | more)


def _known(frame: str, arm_m: float, mass_kg: float, radius_m: float, more: dict[str, Any]) -> Known:
    hubs, spin = draft.layout(arm_m, frame)
    mass, radius = Parameter(mass_kg, 0.01, "kg", "given"), Parameter(radius_m, 0.0, "m", "given")
    return Known(
        name=frame, mass_kg=mass, hub_body_m=hubs, spin=spin, rotor_radius_m=radius, hover_rad_s=500.0, **more
    )  # fmt: skip
