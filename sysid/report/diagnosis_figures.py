"""The pictures of a diagnosis: the staircase, what speaks for the leading candidates, the curve that has no name."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flight.rotations import FloatArray
from sysid.diagnosis.evidence import explained
from sysid.diagnosis.evidence.candidates import Candidate
from sysid.diagnosis.evidence.free_form import VARIABLE, along_axes, of_thrust
from sysid.diagnosis.examined import reproduced
from sysid.diagnosis.findings import OutsideFinding
from sysid.diagnosis.procedure import Diagnosis
from sysid.estimator.flights.sampling import means_over
from sysid.estimator.validation.comparison import SPAN_S, Residual
from sysid.report import drawing, residual_plots, words
from sysid.report.added_variable import added_variable, left_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BEFORE, AFTER = "fitted", "fitted, with what was added"
MOST_CANDIDATES = 4
"""Leading candidates with a picture of their own."""
MOST_ALIKE = 12
"""Candidates in the picture of confounded effects."""
NO_CAUSE = ("constant", "time", "x", "y")
"""Variables that no effect of the vehicle follows."""
TOLD = 1e-3
"""Candidates less significant than this have nothing to show."""


def write(found: Diagnosis, folder: Path, *, suffix: str = "svg") -> list[Path]:
    """Write every figure; returns the files, in the order they are to be read."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    first, last = found.search.models[0], found.search.models[-1]
    named = {BEFORE: left_of(first)}
    if last is not first:
        named[AFTER] = left_of(last)
    drawings = {}
    if found.outside is not None:
        drawings["outside"] = outside(found, found.outside)
    for i, candidate in enumerate(leading(found)):
        drawings[f"candidate_{i + 1}"] = evidence_for(found, candidate)
    drawings["staircase"] = staircase(found)
    judged = unseen(found)
    over_time = judged if last is not first else {BEFORE: judged[BEFORE]} if judged else {}
    over_time = over_time or named
    loudest = residual_plots.loudest(over_time[BEFORE])
    held_out = ", held out" if judged else ""
    title = f"Unexplained on {over_time[BEFORE][loudest].flight.name}{held_out}, body axes"
    drawings["residual_share"] = residual_plots.heat_map(named, judged)
    drawings["residual_wrench"] = residual_plots.over_time(over_time, loudest, title)
    drawings["confounded"] = confounded(found)
    return [drawing.written(figure, folder / f"{name}.{suffix}") for name, figure in drawings.items()]


def unseen(found: Diagnosis) -> dict[str, Sequence[Residual]]:
    """What the first and the last fitted model leave of the held-out flights, if there were any."""
    if not found.held_out:
        return {}
    first, last = found.staircase[1].model, found.staircase[-1].model
    return {BEFORE: found.judged.residuals[first], AFTER: found.judged.residuals[last]}


def leading(found: Diagnosis) -> list[Candidate]:
    """Candidates worth a picture: those added, then those tried, then the most significant.

    What acts on a sensor alone makes no force or torque to draw.
    """
    tried = [a.name for a in found.attempts]
    wanted = [*found.additions, *found.proxies, *tried, *(s.name for s in found.candidates if s.significance < TOLD)]
    candidate_set = {s.name: s for s in found.search.models[0].candidate_set.candidates}
    shown = [candidate_set[name] for name in dict.fromkeys(wanted) if name in candidate_set]
    return [candidate for candidate in shown if candidate.channels][:MOST_CANDIDATES]


def staircase(found: Diagnosis) -> "Figure":
    """Prediction errors of each model of the history, one panel per horizon."""
    horizons = list(found.staircase[0].position_m)
    labels = [words.named(s.model, {a.name for a in found.attempts}) for s in found.staircase]
    figure, axes = drawing.figure(1, len(horizons), (12.0, 1.2 + 0.42 * len(labels)), sharey=True)
    for panel, horizon in zip(axes[0], horizons, strict=True):
        values = 1000.0 * np.array([s.position_m[horizon] for s in found.staircase])
        colours = [drawing.look().pale] * len(values)
        if len(values) > 2:  # something was added to the fitted model
            colours[-1] = drawing.look().colours[2] if values[-1] <= values[1] else drawing.look().colours[0]
        panel.barh(range(len(values)), values, color=colours, height=0.7)
        for place, value in enumerate(values):
            fell = 0.0 if place == 0 else value / values[place - 1] - 1.0
            number = f" {value:.0f}" if value >= 1000.0 else f" {value:.3g}"
            said = f"{number}  {fell:+.0%}" if abs(fell) >= 0.005 else number
            panel.text(value, place, said.replace("-", "−"), va="center", fontsize=8, color=drawing.look().ink)
        panel.set_xlim(0.0, 1.55 * values.max())
        panel.set_yticks(range(len(labels)), labels, fontsize=9)
        panel.set_ylim(len(labels) - 0.5, -0.5)
        drawing.plain(panel, f"after {horizon}", "position error, rms (mm)", "")
        panel.grid(False, axis="y")
    on = f"held-out flights {', '.join(found.held_out)}" if found.held_out else "the training flights"
    drawing.headed(figure, f"Prediction error of each model on {on}; change from the model above")
    return figure


def evidence_for(found: Diagnosis, candidate: Candidate) -> "Figure":
    """What a candidate explains, all other parameters refitted, and what is left of it on flights that only judge."""
    model = found.search.models[0]
    shown = added_variable(model, candidate)
    before = left_of(model)
    variable = follows(shown.trace, before)
    judged = unseen(found)
    figure, axes = drawing.figure(1, 2 + bool(judged), (12.0, 3.6), sharey=True)
    scale, written = residual_plots.unit(shown.channel)
    title, label = words.effect(candidate.name), residual_plots.labelled(variable)
    panel = axes[0, 0]
    at = explained.read(before, VARIABLE[variable])
    residual_plots.scatter(panel, at, scale * shown.partial_residual, drawing.look().colours[0])
    centre, mean, _ = drawing.binned(at, scale * shown.trace)
    panel.plot(centre, mean, "--", color=drawing.look().colours[1], linewidth=1.6, label="the effect at its size")
    panel.legend(frameon=False, fontsize=8)
    drawing.plain(panel, "the effect and what is left beside it", label, f"{shown.channel} ({written})")
    panel = axes[0, 1]
    residual_plots.scatter(panel, scale * shown.trace_alone, scale * shown.residual_alone, drawing.look().colours[3])
    reach = np.quantile(scale * shown.trace_alone, [0.005, 0.995])
    panel.plot(reach, reach, "--", color=drawing.look().colours[1], linewidth=1.6, label="as the effect would have it")
    panel.legend(frameon=False, fontsize=8)
    drawing.plain(panel, "less what other parameters explain", f"{title} ({written})", "")
    if judged:
        _left_on_held_out(axes[0, 2], judged, shown.channel, variable)
    drawing.headed(figure, f"{title}: {candidate.regressor} (means over 0.1 s; line: binned mean, 95 % band)")
    return figure


def follows(trace: FloatArray, residuals: Sequence[Residual]) -> str:
    """The variable that a candidate's trace follows most: by the share of its variance between bins of the variable.

    Of those that the flights hold; a voltage, say, that was not recorded is NaN.
    """
    shares = {}
    for variable in explained.variables(residuals):
        values = explained.read(residuals, variable)
        if variable.name not in NO_CAUSE and np.isfinite(values).all():
            _, mean, _ = drawing.binned(values, trace)
            shares[variable.name] = float(mean.var())
    return max(shares, key=lambda name: shares[name])


def _left_on_held_out(panel: "Axes", judged: dict[str, Sequence[Residual]], channel: str, variable: str) -> None:
    """What the first and the last model leave of flights that they were not fitted to."""
    scale, _ = residual_plots.unit(channel)
    last = judged[AFTER]
    at = explained.read(last, VARIABLE[variable])
    residual_plots.scatter(panel, at, scale * in_channel(last, channel), drawing.look().colours[2])
    first = judged[BEFORE]
    if first is not last:
        centre, mean, _ = drawing.binned(explained.read(first, VARIABLE[variable]), scale * in_channel(first, channel))
        panel.plot(centre, mean, ":", color=drawing.look().ink, linewidth=1.4, label="before anything was added")
        panel.legend(frameon=False, fontsize=8)
    drawing.plain(panel, "left on held-out flights by the last model", residual_plots.labelled(variable), "")


def outside(found: Diagnosis, curve: OutsideFinding) -> "Figure":
    """The curve that no known effect explains, with its band; beside it flights that it was not drawn through.

    What rotors' thrust lacks shows in several channels at once and has no residual of its own to be laid beside it.
    """
    scale, written = residual_plots.unit(curve.channel)
    mean = scale * curve.force_or_torque * curve.acceleration
    band = residual_plots.SIGMAS * scale * curve.force_or_torque * curve.band
    figure, axes = drawing.figure(1, 1 if of_thrust(curve.channel) else 2, (12.0, 3.8), sharex=True, sharey=True)
    label = residual_plots.labelled(curve.variable)
    for panel in axes[0]:
        panel.fill_between(curve.at, mean - band, mean + band, color=drawing.look().colours[1], alpha=0.25, linewidth=0)
        panel.plot(curve.at, mean, color=drawing.look().colours[1], linewidth=1.8, label="the curve")
        panel.axhline(0.0, color=drawing.look().ink, linewidth=0.6)
    axes[0, -1].legend(frameon=False, fontsize=8)
    drawing.plain(axes[0, 0], "the curve, from the training flights", label, f"{curve.channel} ({written})")
    sentence = f"{curve.channel} against {curve.variable}: what no known effect explains"
    if of_thrust(curve.channel):
        drawing.headed(figure, f"{sentence} (95 % band)")
        return figure
    left = found.judged.residuals[found.staircase[-1].model] if found.held_out else left_of(found.search.models[-1])
    at = explained.read(left, VARIABLE[curve.variable])
    residual_plots.scatter(axes[0, 1], at, scale * in_channel(left, curve.channel), drawing.look().colours[0])
    judged = f"unexplained on {', '.join(found.held_out)}, not used" if found.held_out else "unexplained there"
    if found.proxies:
        judged = f"{judged}, beside {' and '.join(map(words.effect, found.proxies))}"
    drawing.plain(axes[0, 1], judged, label, "")
    drawing.headed(figure, f"{sentence} (95 % band; dots: means over 0.1 s; line: binned mean)")
    return figure


def in_channel(left: Sequence[Residual], channel: str) -> FloatArray:
    """(m,) residual force or torque in a channel as means over 0.1 s, flights one after the other."""
    parts = []
    for one in left:
        which, weight = along_axes(channel, one.mid)
        parts.append(means_over((one.wrench[:, which] * weight).sum(axis=1)[:, None], one.time_s, SPAN_S)[:, 0])
    return np.concatenate(parts)


def confounded(found: Diagnosis) -> "Figure":
    """Share of each candidate's residual that another candidate reproduces on these flights."""
    model = found.search.models[0]
    order = [s.name for s in found.candidates if s.name in model.scores]
    shown = sorted(order, key=lambda n: model.scores[n].significance)[:MOST_ALIKE]
    candidates = [model.candidate_set.candidate(name) for name in shown]
    table = np.array([[1.0 if a is b else reproduced(model, a, b) for b in candidates] for a in candidates])
    figure, axes = drawing.figure(1, 1, (12.0, 1.4 + 0.3 * len(shown)))
    panel = axes[0, 0]
    image = panel.imshow(table, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    for i, j in np.ndindex(*table.shape):
        colour = "white" if table[i, j] > 0.6 else drawing.CELL_INK
        panel.text(j, i, f"{100 * table[i, j]:.0f}", ha="center", va="center", fontsize=7.5, color=colour)
    titles = [words.effect(name) for name in shown]
    panel.set_yticks(range(len(shown)), titles, fontsize=8)
    panel.set_xticks(range(len(shown)), titles, fontsize=8, rotation=40, ha="right")
    panel.tick_params(length=0)
    figure.colorbar(image, ax=panel, label="share of the residual", fraction=0.04, pad=0.02)
    drawing.headed(
        figure, "Share of the row's residual (%) that the column reproduces; above 90 the two are confounded"
    )
    return figure
