"""What to record so that matches can tell an error of the camera file apart from the map's scale."""

from mapping.camera.adjustment import LONGEST_STEP_S
from mapping.camera.errors import OF_THE_LENS, UNTIMED, Kind
from mapping.camera.trial import SIGMAS95, Finding, Trial, Verdict

_TURNING = "take images while the vehicle turns about all axes and changes its speed, near things that all cameras see"


def to_record(kind: Kind, *, is_timed: bool) -> str:
    """What would let the matches tell this error.

    Args:
        is_timed: whether the times of the images are known.
    """
    if kind in UNTIMED.values():
        near = f"take images at most {LONGEST_STEP_S:g} s apart, while the vehicle turns and changes its speed"
        return near if is_timed else f"give the times of the images (times.csv) and {near}"
    if kind in OF_THE_LENS:
        return "take images of near things across the whole image, some turned by 90 deg"
    return _TURNING


def least_certain(trial: Trial) -> Finding | None:
    """The error, estimated or possible, that leaves the rig's scale least certain; None if none does."""
    return max((f for f in trial.findings if f.scale_std > 0.0), key=lambda f: f.scale_std, default=None)


def scale_text(trial: Trial, *, is_timed: bool) -> str:
    """A clause: which error leaves the scale least certain, by how much, and what to record; empty if none does."""
    if (finding := least_certain(trial)) is None:
        return ""
    what = "had to estimate" if finding.verdict is Verdict.PRESENT else "hardly tell"
    return (
        f"mostly as these images {what} the {finding.candidate} (± {100.0 * SIGMAS95 * finding.scale_std:.2g} %): "
        f"{to_record(finding.candidate.kind, is_timed=is_timed)}, or measure a length (--length)"
    )
