"""How long to wait for an answer on a machine that has other things to do."""

import os


def patience_s(timeout_s: float) -> float:
    """A time-out that is meant for an idle machine, as many times longer as the processors are over-subscribed.

    The load is what the system reports for the last minute: processes that run or wait for a processor.
    """
    try:
        load = os.getloadavg()[0]
    except (AttributeError, OSError):  # not every system keeps count
        load = 0.0
    return timeout_s * max(1.0, load / (os.cpu_count() or 1))
