"""Messages about the newest identification."""

from typing import Literal

import msgspec

from gcs_web.protocol.base import State


class Identified(msgspec.Struct, frozen=True):
    """One parameter after the fit."""

    name: str
    words: str
    """With the effect where two would read the same."""
    unit: str
    start: float
    """Value before the fit."""
    value: float
    sigma: float
    """Robust standard error; that of the vehicle file where it was held."""
    status: str
    """`free`, `held`, `not identifiable` or `not settled`."""


class ConfoundedPair(msgspec.Struct, frozen=True):
    """Two parameters, in words, of which the flights tell a combination, hardly each by itself."""

    first: str
    second: str
    correlation: float


class Trial(msgspec.Struct, frozen=True):
    """A fit of one flight alone."""

    flight: str
    values: list[float]
    """Of the parameters that the joint fit left free, in their order."""
    sigmas: list[float]
    """Robust standard errors; 0 where this flight alone does not identify it."""


class Identification(State, frozen=True, tag="identification"):
    """What `identify` found last."""

    state: Literal["none", "current", "old"]
    """`old`: the vehicle or one of the flights is another now."""
    verdict: str = ""
    reasons: list[str] = []
    flights: list[str] = []
    parameters: list[Identified] = []
    free: list[str] = []
    """Names of the free parameters."""
    correlation: list[list[float]] = []
    confounded: list[ConfoundedPair] = []
    trials: list[Trial] = []
    written: list[str] = []
    """Files in the project: the new vehicle, the report."""
    vehicle: str = ""
    """Hash of the vehicle that the fit began with."""
    logs: str = ""
