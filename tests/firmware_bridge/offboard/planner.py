"""A planner as a program of its own, which a test may kill. Arguments: see `main`."""

import sys
from dataclasses import replace
from pathlib import Path

import vehicle
from firmware_bridge.offboard import byte_line, settings
from flight import flight_log, silent, trajectory
from goshawk.commands.fly import offboard

_read = settings.read


def with_receiver(line: byte_line.ByteLine) -> settings.Settings:
    """A simulated pilot has a receiver: the simulator takes its pulses, and its settings always say MSP alone."""
    found = _read(line)
    return replace(found, features=found.features - {"RX_MSP"}, receiver_lost=False)


def main() -> None:
    address, receiver, clock_port, vehicle_file, trajectory_file, log_file = sys.argv[1:7]
    where = offboard.Where(address, "127.0.0.1", 0, 0.0, int(clock_port))
    if receiver == "1":
        settings.read = with_receiver
    model, item = vehicle.load(Path(vehicle_file)), trajectory.load(Path(trajectory_file))
    log, early = offboard.fly(model, item, where, progress=silent, cancel=lambda: False)
    flight_log.save(Path(log_file), log)
    sys.stdout.write(early)


if __name__ == "__main__":
    main()
