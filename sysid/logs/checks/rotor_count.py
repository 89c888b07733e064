"""Whether a log and a vehicle file have the same number of rotors."""

from flight import FlightLog, InputError
from flight.flight_log import ROTOR_QUANTITIES
from sysid.logs.checks.finding import Finding, error
from sysid.logs.motors.full_throttle import has_ratios, ratios
from vehicle import Vehicle


def of_log(log: FlightLog) -> int | None:
    """How many rotors the log has; None: it has none."""
    quantity = next((q for q in ROTOR_QUANTITIES if log.has(q)), None)
    if quantity is not None:
        return len(log.names(quantity))
    return len(ratios(log)) if has_ratios(log) else None


def check(log: FlightLog, vehicle: Vehicle) -> list[Finding]:
    """An error where the numbers differ: nothing of the two can be compared then."""
    count = of_log(log)
    if count is None or count == vehicle.rotors:
        return []
    return [error("rotor count", _sentence(count, vehicle), _WAY_OUT)]


def require(log: FlightLog, vehicle: Vehicle, name: str) -> None:
    """
    Raises:
        InputError: the numbers differ.
    """
    count = of_log(log)
    if count is not None and count != vehicle.rotors:
        raise InputError(f"{name}: {_sentence(count, vehicle)}; {_WAY_OUT}")


_WAY_OUT = "take the vehicle file of what flew, or record every rotor"


def _sentence(count: int, vehicle: Vehicle) -> str:
    return f"the log has {count} rotors, {vehicle.name} has {vehicle.rotors}"
