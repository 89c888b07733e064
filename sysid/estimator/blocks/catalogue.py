"""All residual blocks. A new sensor is one file beside this one that makes a `BLOCK`.

The inputs of the model, which have no residual, are in `sysid.estimator.motors`.
"""

import importlib
import pkgutil
from collections.abc import Sequence
from itertools import accumulate
from typing import Any

from sysid.estimator import blocks as folder
from sysid.estimator.blocks.base import Block
from sysid.estimator.blocks.noise import Noise
from sysid.estimator.flights.flight_data import Flight


def _found() -> list[Block]:
    """The `BLOCK` of each file of this folder that has one."""
    names = [module.name for module in pkgutil.iter_modules(folder.__path__, f"{folder.__name__}.")]
    modules = [importlib.import_module(name) for name in names if name != __name__]
    found: list[Block] = [module.BLOCK for module in modules if hasattr(module, "BLOCK")]
    return sorted(found, key=lambda block: (block.order, block.name))


BLOCKS = _found()
"""In the order of their rows."""


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
