"""The callback by which long-running work reports its progress."""

from typing import Protocol


class Progress(Protocol):
    """A callable `progress(stage, fraction)`: the step being worked on, and how much of it is done (0 to 1)."""

    def __call__(self, stage: str, fraction: float) -> None: ...


def silent(stage: str, fraction: float) -> None:
    """A `Progress` that discards every report: the default."""


def within(progress: Progress, whole: str, begin: float, end: float) -> Progress:
    """Progress of a part: its fractions are spread over `begin` to `end`, under the name of the whole stage."""

    def report(stage: str, fraction: float) -> None:
        progress(whole, begin + (end - begin) * fraction)

    return report
