"""Messages about the controller's compensation."""

import msgspec

from gcs_web.protocol.base import VehicleCommand


class ControllerParameter(msgspec.Struct, frozen=True):
    """A parameter of the controller that follows from the vehicle's model."""

    name: str
    unit: str
    """`1`: dimensionless."""
    flies_with: float
    """Read from the vehicle."""
    model: float
    """What the model kept here gives; both are the controller's float32 with the fewest digits that identify them."""
    in_flight: bool
    """Whether it may be changed in the air."""


class NotCompensated(msgspec.Struct, frozen=True):
    """An effect of the model that the controller does not cancel."""

    title: str
    why: str


class Compensation(msgspec.Struct, frozen=True):
    """What the vehicle flies with against the model kept here."""

    vehicle: str
    """Name of the model."""
    version: int
    """Of the vehicle file; 0: as given."""
    parameters: list[ControllerParameter]
    """All that the model gives, in the vehicle's order; gains and limits of the loops are not among them."""
    not_compensated: list[NotCompensated]
    mark: str
    """That the model is for prediction, not for design, and which values; empty without such a mark."""


class PrepareCompensation(VehicleCommand, frozen=True, tag="prepare_compensation", kw_only=True):
    """Read what the vehicle flies with; the reply has `compensation` and a nonce that `send_compensation` uses up."""


class SendCompensation(VehicleCommand, frozen=True, tag="send_compensation", kw_only=True):
    """Set what differs, all of it or nothing; the reply has what was read back."""

    nonce: str
    accepted_mark: str = ""
    """The mark that the page showed and the pilot accepted."""
