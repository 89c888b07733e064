"""All residual blocks. A new sensor is one file beside this one and one line in the list below.

The inputs of the model, which have no residual, are in `sysid.estimator.motors`.
"""

from collections.abc import Sequence
from itertools import accumulate
from typing import Any

from sysid.estimator.blocks.accelerometer import ACCELEROMETER
from sysid.estimator.blocks.anchor import Anchor
from sysid.estimator.blocks.base import Block
from sysid.estimator.blocks.gust import Gust
from sysid.estimator.blocks.gyro import GYRO
from sysid.estimator.blocks.motion import Motion
from sysid.estimator.blocks.noise import Noise
from sysid.estimator.blocks.pose import POSE
from sysid.estimator.flights.flight_data import Flight

BLOCKS: list[Block] = [  # in the order of their rows
    Motion(),
    Gust(),
    POSE,
    Anchor(),
    GYRO,
    ACCELEROMETER,
]


def acting(flight: Flight, noise: Noise, *, between: bool) -> list[Block]:
    """Blocks with rows on a flight, those of its intervals or those of its nodes, in the order of their rows."""
    return [block for block in BLOCKS if block.between == between and block.acts(flight, noise)]


def reported(noise: Noise) -> dict[str, Any]:
    """All noise levels as plain JSON values."""
    return {name: level for block in BLOCKS for name, level in block.reported(noise).items()}


def places(blocks: Sequence[Block]) -> list[slice]:
    """Where the rows of each stand among those of all."""
    ends = list(accumulate(len(block.level_of_row) for block in blocks))
    return [slice(a, b) for a, b in zip([0, *ends[:-1]], ends, strict=True)]
