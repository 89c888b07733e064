"""What `goshawk diagnose` prints: the diagnosis on one screen, and its details."""

import textwrap
from collections.abc import Iterable, Mapping, Sequence

from goshawk.terminal.screen import Screen
from sysid.diagnosis import CandidateFinding, Diagnosis, Size, equation_text
from sysid.diagnosis.experiment_design.outlook import Outlook
from sysid.diagnosis.findings import Verdict
from sysid.diagnosis.from_imu import ImuDiagnosis
from sysid.logs import kinds_of_motion
from sysid.report import residual_plots, words

COLUMNS = 80
MOST_LINES = 18
"""As a rule; with the next command, how many more there are, and the name of what was written 24."""
NEEDED = 0
"""Rank of what is always shown, however many lines that takes."""
NOTE = 4
"""Rank of the first note."""
LONGEST_NAME = 4
"""Words before a colon that may name a flight; more say something."""
MOST_NAMED = 3
"""Of effects of one kind; of more than that a short report gives the number."""
HORIZONS = ("0.1 s", "0.5 s", "1 s")


def short(found: Diagnosis) -> Screen:
    """Verdict, size, what it does to the prediction, what could not be told; what has no room is among the details."""
    ranked = _ranked(found)
    dropped: list[int] = []
    while sum(len(lines) for _, lines in ranked) + bool(dropped) > MOST_LINES and max(r for r, _ in ranked) > NEEDED:
        last = max(range(len(ranked)), key=lambda i: (ranked[i][0], i))
        dropped.append(ranked.pop(last)[0])
    screen = Screen()
    for _, lines in ranked:
        for line in lines:
            screen.line(line)
    if dropped:
        notes = f" and {len(found.findings)} notes" if NOTE in dropped else ""
        more = len(dropped) - (NOTE in dropped)
        screen.line(f"no room here for {more} more sentence{'s' if more != 1 else ''}{notes} (--details)")
    return screen


def _ranked(found: Diagnosis) -> list[tuple[int, list[str]]]:
    """Paragraphs as they are shown, each with its rank: the highest gives way first, and of one rank the last."""
    said = [(NEEDED, _folded(f"{found.verdict} (confidence {found.confidence:.0%})", indent=""))]
    said += [(5, _folded(text)) for text in _forms(found)[:MOST_NAMED]]
    if found.outside is not None:
        said.append((NEEDED, _folded(outside_sentence(found))))
    if found.search.equation is not None:
        law, _, rivals = equation_text.sentence(found.search.equation).partition("; ")
        said.append((NEEDED, _folded(f"the simplest law of it: {law}")))
        said += [(6, _folded(rivals))] if rivals else []
    stated = [s for s in found.candidates if s.verdict in (Verdict.PRESENT, Verdict.PROXY)]
    for i, one in enumerate(stated[:MOST_NAMED]):
        rank = NEEDED if i == 0 else 1 if one.verdict is Verdict.PRESENT else 3
        said.append((rank, _folded(_size_sentence(one))))
    belief = found.belief
    besides = f"{belief.something_unknown:.0%} something unknown, {belief.otherwise:.0%} another known effect"
    said.append((2, _folded(f"besides or instead: {besides}")))
    said.append((NEEDED, _folded(_envelope(found))))
    said.append((NEEDED, _prediction(found)))
    judged, remedy = _of_the_fit(found)
    said.append((NEEDED, _folded(judged, indent="")))
    said += [(1, _folded(remedy))] if remedy else []
    if found.cause is not None:
        said.append((NEEDED, _folded(f"likely cause, by a trial: {found.cause.sentence}", indent="")))
    said.append((NEEDED, _folded(_told_and_not(found), indent="")))
    if found.findings:
        alike = found.findings[0].startswith(kinds_of_motion.ALIKE)
        said.append((NEEDED if alike else NOTE, _folded(_first_note(found.findings, whole=alike), indent="")))
    return said


def _first_note(notes: Sequence[str], *, whole: bool) -> str:
    """The first note, or its first clause, and how many more there are."""
    clause = _first_clause(notes[0])[0]
    head = clause.partition(": ")[0]
    first = notes[0] if whole else head if len(head.split()) > LONGEST_NAME else clause
    more = f", and {len(notes) - 1} more note{'s' if len(notes) > 2 else ''}" if len(notes) > 1 else ""
    return f"note: {first}{more}"


def _first_clause(text: str) -> tuple[str, str]:
    """A text to its first semicolon or full stop, and what follows."""
    ends = [at for mark in ("; ", ". ") if (at := text.find(mark)) >= 0]
    return (text[: min(ends)], text[min(ends) + 2 :]) if ends else (text, "")


def _forms(found: Diagnosis) -> list[str]:
    return [one.sentence for one in found.families if one.has_forms]


def _envelope(found: Diagnosis) -> str:
    """In a line."""
    e = found.envelope
    level, climb, sink = f"{e.level_speed_m_s:.1f}", f"{e.climb_m_s:.1f}", f"{e.sink_m_s:.1f}"
    return f"within the flown envelope: level {level}, climb {climb}, sink {sink} m/s, turns {e.rate_rad_s:.1f} rad/s"


def _of_the_fit(found: Diagnosis) -> tuple[str, str]:
    """Its verdict with the first clause of the first reason, how many more reasons there are, and how far off it is
    beside the model given; and the rest of the first reason: what to do about it."""
    low, high = found.predicts.ratio90
    ratio = f"; 0.5 s ahead {low:.2g} to {high:.2g} times as far off as the model given (90 %)"
    reasons = found.fit_verdict.reasons
    said, rest = _first_clause(reasons[0]) if reasons else ("", "")
    more = f" (and {len(reasons) - 1} more)" if len(reasons) > 1 else ""
    verdict = f"{found.fit_verdict.use}{': ' if said else ''}{said}{more}"
    return f"the fit is {verdict}{ratio if high < float('inf') else ''}", rest


def details(found: Diagnosis, outlooks: Mapping[str, Outlook]) -> Screen:
    """Everything that was looked at: probabilities, attempts, all models, all candidates, all notes."""
    screen = Screen()
    screen.line(found.belief.sentence(named=found.says_missing))
    screen.line(found.envelope.sentence)
    for text in _forms(found):
        screen.line(text)
    if found.search.equation is not None:
        screen.line(f"the simplest law of it: {equation_text.sentence(found.search.equation)}")
    screen.line(f"the fit is {found.fit_verdict.sentence}")
    for reason in found.fit_verdict.reasons[1:]:
        screen.line(f"  and: {reason}")
    for attempt in found.attempts:
        screen.line(f"{attempt.name} {attempt.sentence}")
    _staircase(screen, found)
    heads = ("candidate", "verdict", "parameter", "size ± sigma", "excl. >", "detectable >", "mm", "confidence")
    screen.table(
        "candidate effects (mm: position error that the effect causes within 0.5 s)",
        heads,
        [row for s in found.candidates for row in _rows(s)],
    )
    alike = [(s.name, ", ".join(f"{n} ({share:.0%})" for n, share in s.confounded)) for s in found.candidates]
    if any(names for _, names in alike):
        screen.table("confounded effects in these flights", ("candidate", "collinear with"), [a for a in alike if a[1]])
    reasons = [
        (s.name, f"{s.reason}; {outlooks[s.name].sentence}" if s.name in outlooks else s.reason)
        for s in _inconclusive(found)
    ]
    reasons += [(name, f"unobservable: {why}") for name, why in found.invisible]
    if reasons:
        screen.table("inconclusive from these flights, and why", ("effect", "reason"), reasons)
    for finding in found.findings:
        screen.line(f"note: {finding}")
    return screen


def short_of_imu(found: ImuDiagnosis) -> Screen:
    """Of flights without a pose: verdict, sizes, what could not be told."""
    screen = Screen()
    _paragraph(screen, f"{found.verdict} (confidence {found.confidence:.0%})", indent="")
    for one in found.named:
        sizes = (
            f"{s.parameter.split('.')[-1]} {s.value:.3g} ({s.interval90[0]:.3g} to {s.interval90[1]:.3g}) {s.unit}"
            for s in one.sizes
        )
        _paragraph(screen, f"{one.name}: {', '.join(sizes)}".rstrip())
    _paragraph(screen, f"the fit is {found.fit.verdict.sentence}", indent="")
    excluded = sum(one.verdict is Verdict.EXCLUDED for one in found.candidates)
    open_ = [one.name for one in found.candidates if one.verdict is Verdict.INCONCLUSIVE]
    told = f"; inconclusive: {_some(open_)}" if open_ else ""
    _paragraph(
        screen,
        f"excluded at sizes that matter: {excluded} effects{told}; unobservable without a pose: "
        f"{len(found.invisible)} (--details)",
        indent="",
    )
    return screen


def details_of_imu(found: ImuDiagnosis) -> Screen:
    """Of flights without a pose: all candidates, all notes."""
    screen = Screen()
    rows = [
        (one.name, str(one.verdict), s.parameter.split(".")[-1], f"{s.value:.3g} ± {s.half90:.1g}", s.unit)
        for one in found.candidates
        for s in one.sizes
    ]
    screen.table("candidate effects", ("candidate", "verdict", "parameter", "size ± 90 %", "unit"), rows)
    reasons = [(one.name, one.reason) for one in found.candidates if one.verdict is Verdict.INCONCLUSIVE]
    reasons += [(name, f"unobservable: {why}") for name, why in found.invisible]
    screen.table("inconclusive from these flights, and why", ("effect", "reason"), reasons)
    for finding in found.fit.findings:
        screen.line(f"note: {finding}")
    return screen


def outside_sentence(found: Diagnosis) -> str:
    """A sentence on the curve that no known effect explains."""
    o = found.outside
    assert o is not None
    scale, unit = residual_plots.unit(o.channel)
    curve = scale * o.acceleration * o.force_or_torque
    return (
        f"{words.channel(o.channel)} ({o.channel}) follows {words.variable(o.variable)} ({o.variable}), "
        f"from {curve.min():.2g} to {curve.max():.2g} {unit} over "
        f"{o.at[0]:.3g} to {o.at[-1]:.3g} {o.variable_unit} (confidence {o.confidence:.0%})"
    )


def _paragraph(screen: Screen, text: str, indent: str = "  ") -> None:
    for line in _folded(text, indent):
        screen.line(line)


def _folded(text: str, indent: str = "  ") -> list[str]:
    """In lines of a terminal's width; names are not broken."""
    return textwrap.wrap(
        text, COLUMNS, initial_indent=indent, subsequent_indent=indent + "  ", break_long_words=False,
        break_on_hyphens=False,
    )  # fmt: skip


def _size_sentence(finding: CandidateFinding) -> str:
    """Sizes with their intervals, those that may be nothing by name alone, and what the effect does."""
    flown = [s for s in finding.sizes if s.sigma > 0.0]
    shown = [s for s in flown if s.half90 < abs(s.value)] or flown
    said = [
        f"{s.parameter.split('.')[-1]} {s.value:.3g} ({s.interval90[0]:.3g} to {s.interval90[1]:.3g}) {s.unit}".rstrip()
        for s in shown
    ]
    rest = [s.parameter.split(".")[-1] for s in flown if s not in shown]
    said += [f"{', '.join(rest)} not apart from 0"] if rest else []
    return f"{finding.name}: {', '.join(said)}; alone {1000.0 * finding.error_m:.1f} mm of position in 0.5 s"


def _prediction(found: Diagnosis) -> list[str]:
    """Errors of the model as given, of the fitted one and of the one with all that was added."""
    stairs = [*found.staircase[:2], *found.staircase[2:][-1:]]
    horizons = [h for h in HORIZONS if h in stairs[0].position_m]
    on = "held-out flights" if found.held_out else "the training flights"
    rows = [(f"  {s.model}", [f"{1000.0 * s.position_m[h]:.1f}" for h in horizons]) for s in stairs]
    rows.insert(0, (f"position error on {on}, mm rms, after", horizons))
    width = max(len(name) for name, _ in rows)
    return [f"{name:<{width}}{''.join(f'{cell:>9}' for cell in cells)}" for name, cells in rows]


def _told_and_not(found: Diagnosis) -> str:
    """How many effects are excluded; which these flights cannot tell."""
    excluded = sum(s.verdict == Verdict.EXCLUDED for s in found.candidates)
    open_ = [s.name for s in _inconclusive(found)]
    told = f"; inconclusive: {_some(open_)}" if open_ else ""
    return f"excluded at sizes that matter: {excluded}{told}; unobservable here: {len(found.invisible)} (--details)"


def _some(names: Iterable[str]) -> str:
    names = list(names)
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more


def _inconclusive(found: Diagnosis) -> list[CandidateFinding]:
    return [s for s in found.candidates if s.verdict == Verdict.INCONCLUSIVE]


def _staircase(screen: Screen, found: Diagnosis) -> None:
    horizons = list(found.staircase[0].position_m)
    on = ", ".join(found.held_out) if found.held_out else "the training flights (none was held out)"
    rows = [(s.model, *(f"{1000.0 * s.position_m[h]:.1f}" for h in horizons)) for s in found.staircase]
    screen.table(f"position error (mm, rms) on {on}", ("model", *(f"after {h}" for h in horizons)), rows)


def _rows(candidate: CandidateFinding) -> list[tuple[str, ...]]:
    """One line per parameter; the values of the candidate as a whole are in the first."""
    heads = ((candidate.name, candidate.verdict), *((("", ""),) * (len(candidate.sizes) - 1)))
    whole = (f"{1000.0 * candidate.error_m:.1f}", f"{candidate.confidence:.0%}")
    return [
        (*head, size.parameter.split(".")[-1], *_size(size), *(whole if head[0] else ("", "")))
        for head, size in zip(heads, candidate.sizes, strict=True)
    ]


def _size(size: Size) -> tuple[str, str, str]:
    """Size with sigma, upper bound, smallest detectable size; the unit is in the parameter's name."""
    if size.sigma == 0.0:
        return "not flown", "", ""
    return f"{size.value:.3g} ± {size.sigma:.1g}", f"{size.excluded_above:.2g}", f"{size.smallest_visible:.2g}"
