"""What models leave unexplained: over time, against what explains it, and along the flown path."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from flight.rotations import FloatArray
from sysid.diagnosis.evidence import explained
from sysid.diagnosis.evidence.free_form import THRUST, UNIT, VARIABLE
from sysid.estimator.flights.sampling import means_over
from sysid.estimator.result import CHANNELS
from sysid.estimator.validation.comparison import SPAN_S, Residual
from sysid.report import drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Residuals = Mapping[str, Sequence[Residual]]
"""Model to its residual on each flight."""
NOTABLE = 0.03
"""Shares above this are written into the heat map."""
FLATTEST = 0.4
"""Of a flown path, as drawn."""
LEAST_SHOWN = 0.5
"""A flight shorter than this share of the longest is not shown over time."""
SIGMAS = 1.96
"""Half the width of a 95 % band, in standard deviations."""


def unit(channel: str) -> tuple[float, str]:
    """Scale and unit a channel is drawn in."""
    if channel[0] == THRUST:
        return 100.0, "% of the thrust"
    return (1000.0, "mN m") if channel[0] == "M" else (1.0, "N")


def over_time(named: Residuals, flight: int, title: str, channels: Sequence[str] = CHANNELS) -> "Figure":
    """Residual force and torque per body axis on one flight, with the band that white noise would keep to."""
    rows = len(channels) // 3
    figure, axes = drawing.figure(rows, 3, (12.0, 2.6 * rows + 0.3 * len(named)), sharex="col")
    for place, (panel, channel) in enumerate(zip(axes.ravel(), channels, strict=True)):
        i = CHANNELS.index(channel)
        scale, written = unit(channel)
        for colour, (name, residuals) in zip(drawing.cycle(named), named.items(), strict=True):
            one = residuals[flight]
            smooth = scale * one.means()[:, i]
            time_s = one.time_s[0] + SPAN_S * (np.arange(len(smooth)) + 0.5)
            outside = float((np.abs(smooth) > SIGMAS * scale * one.sigma[i]).mean())
            label = f"{name}: {drawing.rms(smooth):.2g} {written}, {outside:.0%} outside its band"
            panel.plot(time_s, smooth, color=colour, linewidth=1.0, label=label)
        _measured_disturbance(panel, next(iter(named.values()))[flight], i)
        band = SIGMAS * scale * list(named.values())[-1][flight].sigma[i]
        panel.axhspan(-band, band, color=drawing.look().pale, alpha=0.5, linewidth=0, zorder=0)
        panel.axhline(0.0, color=drawing.look().ink, linewidth=0.6)
        panel.legend(frameon=False, fontsize=7.5, loc="lower right", bbox_to_anchor=(1.02, 0.97), borderpad=0.2)
        drawing.plain(panel, "", "time (s)" if place >= 3 * (rows - 1) else "", f"unexplained {channel} ({written})")
    drawing.headed(figure, f"{title} (means over {SPAN_S:g} s; grey: 95 % band of the white noise of the last model)")
    return figure


def _measured_disturbance(panel: "Axes", one: Residual, channel: int) -> None:
    """What the vehicle's observer found, where the log holds it."""
    found = one.disturbance_means()
    if found is None or not np.isfinite(found).any():
        return
    scale, written = unit(CHANNELS[channel])
    values = scale * found[:, channel]
    time_s = one.time_s[0] + SPAN_S * (np.arange(len(values)) + 0.5)
    label = f"measured disturbance: {drawing.rms(values[np.isfinite(values)]):.2g} {written}"
    panel.plot(time_s, values, "--", color=drawing.look().ink, linewidth=1.0, label=label)


def heat_map(named: Residuals, unseen: Residuals | None = None) -> "Figure":
    """Share of each channel's residual that a curve of each variable predicts, one panel per model.

    Args:
        unseen: residuals of flights that only judge the curves; without them each flight is judged by the others.
    """
    judging = {name: (unseen or {}).get(name, ()) for name in named}
    found = {name: explained.shares(residuals, judging[name]) for name, residuals in named.items()}
    figure, axes = drawing.figure(len(found), 1, (12.0, 0.4 + 2.5 * len(found)), sharex=True)
    image = None
    for panel, (name, (variables, shares)) in zip(axes[:, 0], found.items(), strict=True):
        image = panel.imshow(shares, cmap="YlOrRd", vmin=0.0, vmax=1.0, aspect="auto")
        for i, j in zip(*np.nonzero(shares > NOTABLE), strict=True):
            colour = "white" if shares[i, j] > 0.6 else drawing.CELL_INK
            panel.text(j, i, f"{100 * shares[i, j]:.0f}", ha="center", va="center", fontsize=7, color=colour)
        panel.set_yticks(range(6), CHANNELS, fontsize=8)
        panel.set_xticks(range(len(variables)), variables, rotation=60, ha="right", fontsize=8)
        panel.set_title(name, loc="left", fontsize=10, color=drawing.look().ink)
        panel.tick_params(length=0)
    assert image is not None
    figure.colorbar(image, ax=axes[:, 0].tolist(), label="share explained", format="{x:.0%}", fraction=0.03, pad=0.01)
    first = next(iter(named))
    how = explained.judged_how(named[first], judging[first])
    drawing.headed(figure, f"Share of the residual (%) that a curve of one variable predicts {how}")
    return figure


def most_telling(residuals: Sequence[Residual], channels: Sequence[str] = CHANNELS) -> tuple[str, str, float]:
    """Channel and variable with the largest share, and the share."""
    variables, found = explained.shares(residuals)
    rows = [CHANNELS.index(c) for c in channels]
    row, column = np.unravel_index(int(np.argmax(found[rows])), found[rows].shape)
    return channels[int(row)], variables[int(column)], float(found[rows][row, column])


def against(named: Residuals, pairs: Sequence[tuple[str, str]]) -> "Figure":
    """Residual against a variable with its binned mean and 95 % band: one row per pair, one column per model."""
    figure, axes = drawing.figure(len(pairs), len(named), (12.0, 0.4 + 3.0 * len(pairs)), sharey="row", sharex="row")
    found = {name: explained.shares(residuals) for name, residuals in named.items()}
    for row, (channel, variable) in zip(axes, pairs, strict=True):
        scale, written = unit(channel)
        for i, (panel, colour, (name, residuals)) in enumerate(
            zip(row, drawing.cycle(named), named.items(), strict=True)
        ):
            left = scale * np.concatenate([r.means() for r in residuals])[:, CHANNELS.index(channel)]
            scatter(panel, explained.read(residuals, VARIABLE[variable]), left, colour)
            variables, shares = found[name]
            share = shares[CHANNELS.index(channel), variables.index(variable)]
            title = f"{name}: {variable} predicts {share:.0%} of {channel}"
            drawing.plain(panel, title, labelled(variable), f"unexplained {channel} ({written})" if i == 0 else "")
    how = explained.judged_how(next(iter(named.values())))
    drawing.headed(
        figure, f"The variables that explain most of force and torque {how}; line: binned mean with 95 % band"
    )
    return figure


def against_all(named: Residuals) -> "Figure":
    """Every channel's residual against every variable: binned means with their 95 % bands, one row per channel.

    The variables stand side by side in the same axes, each over its own range: a panel for each pair of channel and
    variable takes ten times as long to draw.
    """
    every = [v for v in explained.variables(next(iter(named.values()))) if v.name != "constant"]
    read = {name: [explained.read(residuals, v) for v in every] for name, residuals in named.items()}
    reached = [(min(map(np.min, each)), max(map(np.max, each))) for each in zip(*read.values(), strict=True)]
    changed = [i for i, (low, high) in enumerate(reached) if high > low]  # the others show nothing in these flights
    variables, ranges = [every[i] for i in changed], [reached[i] for i in changed]
    along = {name: [values[i] for i in changed] for name, values in read.items()}
    figure, axes = drawing.figure(6, 1, (len(variables), 8.0), sharex=True)
    for colour, (name, residuals) in zip(drawing.cycle(named), named.items(), strict=True):
        left = np.concatenate([r.means() for r in residuals])
        for panel, values, channel in zip(axes[:, 0], left.T, CHANNELS, strict=True):
            x, mean, band = _side_by_side(along[name], ranges, unit(channel)[0] * values)
            panel.fill_between(x, mean - band, mean + band, color=colour, alpha=0.25, linewidth=0)
            panel.plot(x, mean, color=colour, linewidth=1.2, label=name)
    for panel, channel in zip(axes[:, 0], CHANNELS, strict=True):
        panel.set_ylabel(f"{channel} ({unit(channel)[1]})", fontsize=8)
        panel.axhline(0.0, color=drawing.look().ink, linewidth=0.5)
        panel.vlines(
            np.arange(len(variables) + 1) - _GAP, 0.0, 1.0, drawing.look().pale, transform=panel.get_xaxis_transform()
        )
        panel.tick_params(labelsize=6, axis="both", length=0)
    names = [labelled(v.name).replace(" (", "\n(") for v in variables]
    spans = [f"{float(f'{low:.2g}'):g} to {float(f'{high:.2g}'):g}" for low, high in ranges]
    texts = [f"{name}\n{span}" for name, span in zip(names, spans, strict=True)]
    axes[5, 0].set_xticks(np.arange(len(variables)) + 0.5 - _GAP, texts)
    axes[5, 0].set_xlim(-_GAP, len(variables) - _GAP)
    axes[0, 0].legend(frameon=False, fontsize=6)
    drawing.headed(figure, "Residual against every variable: binned means and their 95 % bands, one scale a row")
    return figure


_GAP = 0.05
"""Half the space between two variables, as a share of a variable's width."""


def _side_by_side(
    along: Sequence[FloatArray], ranges: Sequence[tuple[float, float]], values: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Place, binned mean and half the band of `values` over each variable in turn, with NaN between two variables.

    Variable i takes up i to i + 1 less the gap.
    """
    parts = [np.empty((3, 0))]
    for i, (variable, (low, high)) in enumerate(zip(along, ranges, strict=True)):
        if np.ptp(variable) > 0.0:
            centre, mean, error = drawing.binned(variable, values)
            place = i + (1.0 - 2.0 * _GAP) * (centre - low) / (high - low)
            parts += [np.stack([place, mean, SIGMAS * error]), np.full((3, 1), np.nan)]
    x, mean, band = np.concatenate(parts, axis=1)
    return x, mean, band


def labelled(variable: str) -> str:
    """A variable with its unit."""
    return f"{variable} ({UNIT[variable]})" if UNIT[variable] else variable


def loudest(residuals: Sequence[Residual]) -> int:
    """The flight of which most is unexplained, over the noise; short pieces of flights show too little of it."""
    length_s = [float(np.ptp(one.time_s)) for one in residuals]
    shown = [i for i, length in enumerate(length_s) if length >= LEAST_SHOWN * max(length_s)]
    return max(shown, key=lambda i: float(((residuals[i].means() / residuals[i].sigma) ** 2).mean()))


def scatter(panel: "Axes", x: FloatArray, y: FloatArray, colour: str) -> None:
    """Points, and their binned mean with its band."""
    here = drawing.look()
    panel.plot(x, y, ".", color=colour, alpha=0.25, markersize=3.5, rasterized=True)
    centre, mean, error = drawing.binned(x, y)
    panel.fill_between(centre, mean - SIGMAS * error, mean + SIGMAS * error, color=here.ink, alpha=0.25, linewidth=0)
    panel.plot(centre, mean, "o-", color=here.ink, markersize=3.5, linewidth=1.2)
    panel.axhline(0.0, color=here.ink, linewidth=0.6)
    low, high = np.quantile(y, [0.003, 0.997])
    reach = max(-low, high, float(np.abs(mean).max()))
    if not panel.get_autoscaley_on():  # panels that share their axis: room for all
        reach = max(reach, panel.get_ylim()[1])
    panel.set_ylim(-reach, reach)


def path(named: Residuals, flight: int, title: str) -> "Figure":
    """The flown path from above and from the side, coloured by how far the residual exceeds its noise."""
    figure, axes = drawing.figure(2, len(named), (12.0, 7.0), sharex=True, sharey="row")
    image = None
    for i, (name, residuals) in enumerate(named.items()):
        one = residuals[flight]
        size = np.sqrt(((one.means() / one.sigma) ** 2).mean(axis=1))
        place = means_over(one.position_world_m, one.time_s, SPAN_S)
        for panel, (down, label) in zip(axes[:, i], ((1, "y (m)"), (2, "z (m)")), strict=True):
            panel.plot(place[:, 0], place[:, down], color=drawing.look().pale, linewidth=0.8, zorder=1)
            image = panel.scatter(place[:, 0], place[:, down], c=size, s=14, cmap="inferno_r", vmin=0.0, vmax=4.0)
            side = f"{name}, from {'above' if down == 1 else 'the side'}"
            drawing.plain(panel, side, "x (m)" if down == 2 else "", label if i == 0 else "")
    for row in axes:
        _no_flatter_than(row[0], FLATTEST)
    assert image is not None
    figure.colorbar(image, ax=axes.ravel().tolist(), label="residual / its white noise (rms of 6 channels)", pad=0.01)
    drawing.headed(figure, title)
    return figure


def _no_flatter_than(panel: "Axes", flattest: float) -> None:
    """Give the vertical axis at least this share of the horizontal range, so that a few centimetres look like that."""
    across, (low, high) = np.ptp(panel.get_xlim()), panel.get_ylim()
    half = max(0.5 * (high - low), 0.5 * flattest * float(across))
    panel.set_ylim(0.5 * (low + high) - half, 0.5 * (low + high) + half)
