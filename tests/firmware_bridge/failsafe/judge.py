"""What a flight must never do, whatever has gone wrong: the body's record against the bars of the benchmark."""

from harness import Result
from scenario import Reason, State

LARGEST_STOP_M = 0.15
"""Highest clearance at which the controller may stop a rotor."""
HARDEST_TOUCHDOWN_M_S = 1.5
HARDEST_BLIND_TOUCHDOWN_M_S = 2.5
"""After a rotor's death, or without vertical speed or attitude."""
LATEST_TOUCHDOWN_S = 0.25
"""After the rotors have stopped; 0.15 m are fallen in 0.18 s. Later it falls off what it had landed on."""
LONGEST_UNLOGGED_S = 0.02


def flown_touchdown_m_s(result: Result) -> float:
    """Hardest touchdown; the first one where the hardest is a fall off an edge, long after the rotors stopped."""
    fell = 0 < result.stop_s < result.hardest_touchdown_s - LATEST_TOUCHDOWN_S
    return result.first_touchdown_m_s if fell else result.hardest_touchdown_m_s


def violations(
    result: Result,
    *,
    touchdown_m_s: float | None = HARDEST_TOUCHDOWN_M_S,
    may_stop_in_air: bool = False,
    must_fly: bool = True,
) -> list[str]:
    """Empty when all is well.

    Args:
        touchdown_m_s: hardest vertical speed of first contact after flight; None: any.
        may_stop_in_air: killed, or the attitude was lost.
        must_fly: it had no reason to stay on the ground.
    """
    found = []
    if must_fly and not result.flew:
        found.append(f"never flew; orders answered {result.order_reasons}, upload {result.upload_reason}")
    if result.bad_outputs:
        found.append(f"{result.bad_outputs} outputs were not finite or out of range")
    if result.stop_clearance_m > LARGEST_STOP_M and not may_stop_in_air:
        why = f"{result.stop_state.name}, {Reason(result.stop_reason).name}" if result.stop_reason else "no reason"
        found.append(f"rotors stopped {result.stop_clearance_m:.2f} m up ({why})")
    if touchdown_m_s is not None and not may_stop_in_air and flown_touchdown_m_s(result) > touchdown_m_s:
        found.append(f"touched down at {flown_touchdown_m_s(result):.2f} m/s, bar {touchdown_m_s:g}")
    if result.flew and not result.at_rest:
        found.append(f"not at rest after {result.end_s:.0f} s ({result.final_state.name})")
    if any(change.reason == Reason.OK for change in result.changes):
        found.append("a transition has no reason")
    if result.unlogged_slow_s > LONGEST_UNLOGGED_S:
        found.append(f"path limited for {result.unlogged_slow_s:.2f} s without a reason")
    return found


def landed_by(result: Result, reason: int) -> bool:
    """Whether a failsafe with this reason brought it down: the mission went to landing or aborting because of it."""
    ways_down = (State.LANDING, State.ABORTING, State.EMERGENCY)
    return any(change.after in ways_down and change.reason == reason for change in result.changes)
