"""The guard of a flight on an autopilot: `python -m firmware_bridge.autopilot.guard SETUP FD`."""

import sys
from collections.abc import Callable

from firmware_bridge.autopilot import line
from firmware_bridge.autopilot.inner_loop import Autopilot
from firmware_bridge.autopilot.setup import AutopilotSetup
from firmware_bridge.offboard.guard import InnerLoop, process


def main() -> None:
    """The process."""
    setup = AutopilotSetup.from_json(sys.argv[1])
    address = line.parsed(setup.address)

    def opened() -> tuple[InnerLoop, Callable[[], None]]:
        opened = line.MavlinkLine(address, own_system=setup.own_system, system=setup.system)
        return Autopilot(setup, opened, vision=address.vision, position=address.position), opened.close

    process(setup, opened, int(sys.argv[2]))


if __name__ == "__main__":
    main()
