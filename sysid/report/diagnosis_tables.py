"""Tables of a diagnosis in HTML: numbers as people write them, one stripe per candidate."""

import re
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from math import floor, log10

from sysid.diagnosis.findings import CandidateFinding, Size, Verdict
from sysid.diagnosis.thresholds import THRESHOLDS
from sysid.report import words
from sysid.report.pages import table
from vehicle import Parameter

PLAIN_DECADES = (-3, 4)
"""Numbers from 10 to the first up to 10 to the second are written without a power of ten."""


def measured(value: float, sigma: float) -> str:
    """A value with its standard error, two digits of the latter: `(8.67 ± 0.61)·10⁻⁴`."""
    if sigma <= 0.0:
        return plain(value)
    power = _power(max(abs(value), sigma))
    scale = 10.0**power
    digits = max(0, 1 - floor(log10(sigma / scale)))
    text = f"{value / scale:.{digits}f} ± {sigma / scale:.{digits}f}".replace("-", "−")
    return text if power == 0 else f"({text}){_times(power)}"


def plain(value: float) -> str:
    """Two digits, small and large numbers with a power of ten."""
    if abs(value) < 1e-300:
        return "0"
    power = _power(abs(value))
    return f"{value / 10.0**power:.2g}".replace("-", "−") + (_times(power) if power else "")


def chance(probability: float) -> str:
    """A probability that may be tiny."""
    return f"below {plain(1e-12)}" if probability < 1e-12 else plain(probability)


def unit(text: str) -> str:
    """`kg m2` with its 2 raised; nothing for a bare number."""
    return "" if text == "1" else re.sub(r"(?<=[a-z])(\d)", r"<sup>\1</sup>", escape(text))


def _power(size: float) -> int:
    power = floor(log10(size))
    return 0 if PLAIN_DECADES[0] <= power < PLAIN_DECADES[1] else power


def _times(power: int) -> str:
    return f"·10<sup>{str(power).replace('-', '−')}</sup>"


def size_sentence(candidate: CandidateFinding) -> str:
    """An effect that is present, with all its sizes."""
    sizes = ", ".join(
        f"{escape(words.parameter(s.parameter))} = {measured(s.value, s.sigma)} {unit(s.unit)}".strip()
        for s in candidate.sizes
    )
    return f"{escape(words.effect(candidate.name))}: {sizes}."


def candidates(found: Sequence[CandidateFinding]) -> str:
    """Those that are present or in doubt in full; of those excluded, how much of them can be ruled out."""
    open_ = [s for s in found if s.verdict is not Verdict.EXCLUDED]
    excluded = [s for s in found if s.verdict is Verdict.EXCLUDED]
    parts = [_open(open_)] if open_ else ["<p>None is present, and none in doubt.</p>"]
    return "".join(parts + ([_excluded(excluded)] if excluded else []))


def _open(found: Sequence[CandidateFinding]) -> str:
    head = ("candidate", "verdict", "parameter", "size ± σ", "unit", "visible from", "usual")
    names = {"candidate", "verdict", "parameter", "unit"}
    groups = []
    for candidate in found:
        kind = candidate.verdict.split()[0]
        first = (
            f"<td class='word'{{span}}>{escape(words.effect(candidate.name))}</td>"
            f"<td class='word {kind}'{{span}}>{candidate.verdict}</td>"
        )
        last = "".join(
            f"<td{{span}}>{text}</td>"
            for text in (
                f"{1000.0 * candidate.error_m:.1f}",
                chance(candidate.significance),
                f"{candidate.confidence:.0%}",
            )
        )
        rows = [
            f"<td class='word'>{escape(words.parameter(size.parameter))}</td><td>{_size(size)}</td>"
            f"<td class='word'>{unit(size.unit)}</td>"
            f"<td>{plain(size.smallest_visible) if size.sigma > 0.0 else ''}</td><td>{plain(size.usual)}</td>"
            for size in candidate.sizes
        ]
        groups.append(_group(first, rows, last))
    note = (
        "<p class='small'>Visible from: a size that would have been called present nine times in ten. Usual: as "
        "vehicles of this mass, arm and rotor speed have it. mm: position error that the effect makes within 0.5 s at "
        "the size found. Chance: probability that chance alone would explain as much. Probability: that it is "
        "really missing.</p>"
    )
    return _grouped((*head, "mm", "chance", "probability"), names, groups) + note


def _size(size: Size) -> str:
    return measured(size.value, size.sigma) if size.sigma > 0.0 else "not flown"


def _excluded(found: Sequence[CandidateFinding]) -> str:
    groups = [
        _group(
            f"<td class='word'{{span}}>{escape(words.effect(candidate.name))}</td>",
            [
                f"<td class='word'>{escape(words.parameter(size.parameter))}</td><td>{plain(size.excluded_above)}</td>"
                f"<td>{plain(size.usual)}</td><td class='word'>{unit(size.unit)}</td>"
                f"<td>{measured(size.value, size.sigma)}</td>"
                for size in candidate.sizes
            ],
            f"<td{{span}}>{1000.0 * candidate.error_m:.1f}</td>",
        )
        for candidate in found
    ]
    head = ("candidate", "parameter", "excluded above", "usual", "unit", "size ± σ", "mm")
    note = (
        "<p class='small'>Sizes above the one given can be ruled out with 95 %. They are too small to matter: below "
        f"{THRESHOLDS.matters:.0%} of what is usual on a vehicle of this mass, arm and rotor speed. The last column "
        "is at the size found.</p>"
    )
    table = _grouped(head, {"candidate", "parameter", "unit"}, groups)
    many = "1 effect" if len(found) == 1 else f"{len(found)} effects"
    return f"<details><summary>{many} excluded, with the sizes that are ruled out</summary>{table}{note}</details>"


def _group(first: str, rows: Sequence[str], last: str) -> str:
    """One candidate: what belongs to it as a whole spans its rows."""
    span = f" rowspan='{len(rows)}'" if len(rows) > 1 else ""
    lines = list(rows)
    lines[0] = first.format(span=span) + lines[0] + last.format(span=span)
    return "<tbody>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</tbody>"


def _grouped(head: Sequence[str], names: set[str], groups: Iterable[str]) -> str:
    cells = "".join(f"<th{' class=word' if name in names else ''}>{name}</th>" for name in head)
    drawn = f"<table class='grouped'><thead><tr>{cells}</tr></thead>{''.join(groups)}</table>"
    return f"<div class='scroll'>{drawn}</div>"


def confounded(found: Sequence[CandidateFinding]) -> str:
    """Pairs with the same residual, which these flights cannot separate."""
    items = [
        f"<li><b>{escape(words.effect(s.name))}</b> ({s.verdict}): "
        f"{escape(', '.join(f'{words.effect(n)} {share:.0%}' for n, share in alike))}</li>"
        for s in found
        if (alike := s.confounded) and s.verdict is not Verdict.EXCLUDED
    ]
    if not items:
        return "<p>On these flights nothing that is present or in doubt is confounded with another candidate.</p>"
    return (
        "<p>On these flights other candidates reproduce at least "
        f"{THRESHOLDS.confounded:.0%} of the residual of</p><ul>{''.join(items)}</ul>"
    )


def parameters(found: Mapping[str, Parameter]) -> str:
    """All numbers of a vehicle with their errors and where they are from."""
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td>{measured(p.value, p.std) if p.std > 0.0 else f'{p.value:.5g}'}</td>"
        f"<td class='word'>{unit(p.unit)}</td><td class='word'>{escape(p.source)}</td></tr>"
        for name, p in found.items()
    )
    return table(("parameter", "value ± σ", "unit", "source"), rows, words=2)
