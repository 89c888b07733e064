"""The newest identification in the page's terms, as it is kept on disk."""

from collections.abc import Sequence
from pathlib import Path

import msgspec

from flight import file_format
from gcs_web.flights import session_files
from gcs_web.protocol import identified as identified_messages
from gcs_web.protocol.identified import ConfoundedPair, Identified, Trial
from sysid.estimator.result import Identification
from sysid.estimator.verdict import Use
from sysid.report import words


def identification_file(folder: Path) -> Path:
    return folder / ".session" / "identification.json"


def shown(
    fit: Identification,
    trials: Sequence[Identification],
    flights: Sequence[str],
    *,
    vehicle_hash: str,
    contents: str,
    written: Sequence[str],
    use: Use,
    reasons: Sequence[str],
) -> identified_messages.Identification:
    """
    Args:
        trials: fits of each flight alone, in their order; none where it was not asked for.
        contents: `reading.contents` of the flights, taken before they were read.
        use: of the verdict on fit, logs and predictions together.
    """
    names = [e.name for e in fit.parameters]
    said = dict(zip(names, _in_words(names), strict=True))
    return identified_messages.Identification(
        "current",
        str(use),
        [words.parameters_named(reason, names) for reason in reasons],
        list(flights),
        [Identified(e.name, said[e.name], e.unit, e.start, e.value, e.std_robust, e.status) for e in fit.parameters],
        list(fit.free_names),
        fit.correlation.tolist(),
        [ConfoundedPair(said[a], said[b], r) for a, b, r in fit.confounded()],
        [_trial(flight, alone, fit.free_names) for flight, alone in zip(flights, trials, strict=False)],
        list(written),
        vehicle_hash,
        contents,
    )


def _trial(flight: str, alone: Identification, names: Sequence[str]) -> Trial:
    found = [alone.estimate(name) for name in names]
    sigmas = [e.std_robust if e.status == "free" else 0.0 for e in found]
    return Trial(flight, [e.value for e in found], sigmas)


def _in_words(names: Sequence[str]) -> list[str]:
    """With the effect where two would read the same."""
    short = [words.parameter(name) for name in names]
    return [
        f"{said} ({words.effect(name.split('.')[0])})" if short.count(said) > 1 and "." in name else said
        for said, name in zip(short, names, strict=True)
    ]


def save(folder: Path, found: identified_messages.Identification) -> None:
    file_format.write_bytes(identification_file(folder), msgspec.json.encode(found))


def load(folder: Path) -> identified_messages.Identification:
    """The newest one; state `none` where there is none that can be read."""
    return session_files.read(
        identification_file(folder), identified_messages.Identification
    ) or identified_messages.Identification("none")
