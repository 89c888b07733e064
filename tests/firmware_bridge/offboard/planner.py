"""A planner as a program of its own, which a test may kill. Arguments: see `main`."""

import sys
from pathlib import Path

import vehicle
from flight import flight_log, silent, trajectory
from goshawk.commands.fly import offboard


def main() -> None:
    address, receiver, clock_port, vehicle_file, trajectory_file, log_file = sys.argv[1:7]
    where = offboard.Where(address, "127.0.0.1", 0, 0.0, int(clock_port), receiver=receiver == "1")
    model, item = vehicle.load(Path(vehicle_file)), trajectory.load(Path(trajectory_file))
    log, early = offboard.fly(model, item, where, progress=silent, cancel=lambda: False)
    flight_log.save(Path(log_file), log)
    sys.stdout.write(early)


if __name__ == "__main__":
    main()
