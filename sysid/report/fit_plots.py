"""Pictures of one identification: what was measured and modelled, what is left, how sure, how it got there."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from flight.rotations import FloatArray
from sysid.estimator.blocks.catalogue import acting
from sysid.estimator.blocks.noise import Noise
from sysid.estimator.flights.flight_data import Flight
from sysid.estimator.flights.sampling import means_over
from sysid.estimator.joint_problem.problem import located
from sysid.estimator.joint_problem.solver import CONVERGED_SIGMA
from sysid.estimator.motors import motor
from sysid.estimator.result import SPAN_S, Identification
from sysid.estimator.trajectory.midpoint import middle, rates_of_change
from sysid.estimator.trajectory.model import unexplained
from sysid.estimator.trajectory.states import States
from sysid.estimator.without_pose import sensing
from sysid.report import drawing
from vehicle import rigid_body

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_FLIGHTS = 6
"""Flights drawn one by one; of more, the longest."""
PANELS_A_ROW = 4


def identification(result: Identification, folder: Path, *, suffix: str = "svg") -> list[Path]:
    """Write `parameters`, `convergence`, `correlation` and per flight `overlay` and `residuals`; returns the files."""
    folder = Path(folder)
    drawings = {
        "parameters": _parameters(result),
        "convergence": _convergence(result),
        "correlation": _correlation(result),
    }
    longest = sorted(range(len(result.flights)), key=lambda i: -len(result.flights[i]))[:MOST_FLIGHTS]
    for i in sorted(longest):
        flight, states = result.flights[i], result.solution.point.states[i]
        drawings[f"overlay_{i + 1}"] = _overlay(result, flight, states)
        drawings[f"residuals_{i + 1}"] = _residuals(result, flight, states)
    return [drawing.written(drawn, folder / f"{name}.{suffix}") for name, drawn in drawings.items()]


def repeated(results: Sequence[Identification], names: Sequence[str], path: Path) -> Path:
    """One parameter a panel over repeated trials, with one-sigma bars (the paper's Fig. 8).

    The dashed line is the mean over the trials; the title says how the spread compares with the bars.
    """
    columns = min(PANELS_A_ROW, len(names))
    rows = -(-len(names) // columns)
    figure, axes = drawing.figure(rows, columns, (3.3 * columns, 2.6 * rows + 0.3))
    trial = np.arange(1, len(results) + 1)
    for i, (panel, name) in enumerate(zip(axes.flat, names, strict=False)):
        found = [r.estimate(name) for r in results]
        value, std = np.array([e.value for e in found]), np.array([e.std_robust for e in found])
        panel.errorbar(trial, value, std, fmt="o", color=drawing.look().colours[1], capsize=3, markersize=4)
        panel.axhline(value.mean(), color=drawing.look().ink, linewidth=0.8, linestyle="--")
        panel.margins(y=0.18)
        panel.set_xlim(0.5, len(results) + 0.5)
        panel.set_xticks(trial)
        drawing.plain(panel, name, "trial" if i + columns >= len(names) else "", found[0].unit)
        panel.yaxis.get_offset_text().set_fontsize(8)
        if len(results) > 1:
            ratio = value.std(ddof=1) / np.sqrt((std**2).mean())
            note = f"spread / bar: {ratio:.1f}"
            panel.text(0.98, 0.97, note, transform=panel.transAxes, ha="right", va="top", fontsize=8)
    for panel in axes.flat[len(names) :]:
        panel.set_visible(False)
    drawing.headed(figure, f"Each parameter over {len(results)} trials; bars are one robust standard error")
    return drawing.written(figure, Path(path))


def _overlay(result: Identification, flight: Flight, states: States) -> "Figure":
    """Force and torque: what the motion shows and what the model gives for the same rotor speeds.

    Force is mass times acceleration less gravity; torque is inertia times angular acceleration.
    """
    figure, axes = drawing.figure(2, 3, (12.0, 5.2), sharex=True)
    here = drawing.look()
    left = _left_over(result, flight, states)
    shown = _motion(result, flight, states)
    time_s = _middles(flight, shown)
    for i, panel in enumerate(axes.ravel()):
        scale, unit = (1.0, "N") if i < 3 else (1000.0, "mN m")
        panel.plot(time_s, scale * shown[:, i], color=here.ink, linewidth=1.4, label="from the motion")
        modelled = scale * (shown - left)[:, i]
        panel.plot(time_s, modelled, color=here.colours[1], linewidth=1.0, label="model at these rotor speeds")
        drawing.plain(panel, _channel(i), "time (s)" if i >= 3 else "", unit)
    _legend_outside(axes[0, 0])
    drawing.headed(figure, f"{flight.name}: force and torque in body axes, means over {SPAN_S:g} s")
    return figure


def _legend_outside(axes: "Axes") -> None:
    handles, labels = axes.get_legend_handles_labels()
    axes.figure.legend(handles, labels, frameon=False, fontsize=9, loc="outside upper right", ncols=2)


def _residuals(result: Identification, flight: Flight, states: States) -> "Figure":
    """What is left in each channel, with the band of two standard deviations of the estimated noise."""
    noise, point = result.noise, result.solution.point
    body = rigid_body(result.vehicle)
    left_std = _unmodelled_std(noise)
    force, torque = body.mass_kg * left_std[:3], body.inertia_kg_m2 @ left_std[3:]
    left = _left_over(result, flight, states)
    rows: list[tuple[str, str, FloatArray, FloatArray, FloatArray, bool]] = [
        ("F", "N", _middles(flight, left), left[:, :3], force, False),
        ("M", "mN m", _middles(flight, left), 1000.0 * left[:, 3:], 1000.0 * torque, False),
    ]
    at = located(flight, states, point, noise)
    for block in acting(flight, noise, between=False):
        residual = block.residual(at)
        for channel in block.channels:
            values = channel.scale * residual[:, channel.rows]
            level = np.full(len(channel.rows), channel.scale * block.channel_level(channel, noise))
            rows.append((channel.name, channel.unit, flight.time_s, values, level, True))
    figure, axes = drawing.figure(len(rows), 3, (12.0, 1.75 * len(rows) + 0.5), sharex=True)
    for panels, (name, unit, time_s, values, level, dots) in zip(axes, rows, strict=True):
        lowest = name == rows[-1][0]
        for i, panel in enumerate(panels):
            panel.axhspan(-2.0 * level[i], 2.0 * level[i], color=drawing.look().pale, alpha=0.6, linewidth=0)
            if dots:
                panel.plot(time_s, values[:, i], ".", color=drawing.look().colours[1], markersize=1.2, rasterized=True)
            else:
                panel.plot(time_s, values[:, i], color=drawing.look().colours[0], linewidth=1.0)
            panel.axhline(0.0, color=drawing.look().ink, linewidth=0.6)
            outside = 100.0 * float((np.abs(values[:, i]) > 2.0 * level[i]).mean())
            title = f"{name} {'xyz'[i]}: {outside:.0f} % outside"
            drawing.plain(panel, title, "time (s)" if lowest else "", unit if i == 0 else "")
    band = "grey: two standard deviations of the estimated noise (5 % lie outside if it is white)"
    drawing.headed(figure, f"{flight.name}: measured less modelled; {band}")
    return figure


def _unmodelled_std(noise: Noise) -> FloatArray:
    """(6,) of a mean over `SPAN_S`, m/s2 and rad/s2: white noise, and disturbances that last."""
    variance = noise.process**2 / SPAN_S
    if noise.gusts is not None:
        size = noise.gusts.size**2
        # force comes in world axes and is drawn in body axes: the mean of the three will do for a band
        variance = variance + np.concatenate([np.full(3, size[:3].mean()), size[3:]])
    return np.sqrt(variance)


def _left_over(result: Identification, flight: Flight, states: States) -> FloatArray:
    """(k, 6) force (N) and torque (N m) the model does not explain, means over `SPAN_S`."""
    if not flight.has_pose:
        return _means(result, flight, sensing.left(flight, result.vehicle, result.solution.point.sensors))
    driven = motor.driven(flight, result.vehicle)
    return _means(result, flight, unexplained(driven, states, result.vehicle))


def _motion(result: Identification, flight: Flight, states: States) -> FloatArray:
    """(k, 6) force and torque (less the gyroscopic term) that the smoothed motion shows."""
    if not flight.has_pose:
        return _means(result, flight, sensing.measured(flight))
    return _means(result, flight, rates_of_change(states, middle(flight, states)))


def _means(result: Identification, flight: Flight, acceleration: FloatArray) -> FloatArray:
    body = rigid_body(result.vehicle)
    wrench = np.concatenate(
        [body.mass_kg * acceleration[:, :3], acceleration[:, 3:] @ np.asarray(body.inertia_kg_m2).T], axis=1
    )
    return means_over(wrench, flight.time_s[:-1], SPAN_S)


def _middles(flight: Flight, means: FloatArray) -> FloatArray:
    return flight.time_s[0] + SPAN_S * (np.arange(len(means)) + 0.5)


def _channel(i: int) -> str:
    return f"{'Force' if i < 3 else 'Torque'} {'xyz'[i % 3]}"


def _parameters(result: Identification) -> "Figure":
    free = [e for e in result.parameters if e.status == "free"]
    figure, axes = drawing.figure(1, 2, (12.0, 0.32 * len(free) + 1.4), width_ratios=[1.0, 0.9])
    place = np.arange(len(free))[::-1]
    size = [max(abs(e.value), 1e-300) for e in free]
    robust = 100.0 * np.array([e.std_robust for e in free]) / size
    simple = 100.0 * np.array([e.std for e in free]) / size
    panel = axes[0, 0]
    panel.barh(place, robust, color=drawing.look().colours[1], height=0.7, label="robust")
    panel.barh(place, simple, color="#9ec6d3", height=0.35, label="plain")
    panel.set_xscale("log")
    panel.set_xlim(max(1e-3, 0.5 * float(np.min([robust.min(initial=1.0), simple.min(initial=1.0)]))), 100.0)
    panel.set_ylim(-0.6, len(free) - 0.4)
    panel.xaxis.set_major_formatter(lambda value, _: f"{value:g} %")
    panel.set_yticks(place, [f"{e.name} = {e.value:.4g} {e.unit}" for e in free])
    panel.legend(frameon=False, fontsize=8, loc="lower right", ncols=2, bbox_to_anchor=(1.0, 1.0))
    drawing.plain(panel, "Standard error", "share of the value (100 %: not significantly different from zero)", "")
    left, panel = np.zeros(len(free)), axes[0, 1]
    for i, flight in enumerate(result.flights):
        share = 100.0 * np.array([e.information[i] for e in free])
        colour = drawing.look().colours[i % len(drawing.look().colours)]
        panel.barh(place, share, left=left, color=colour, height=0.7, label=flight.name, edgecolor=drawing.look().paper)
        left += share
    panel.set_yticks(place, [])
    panel.set_xlim(0.0, 100.0)
    panel.set_ylim(-0.6, len(free) - 0.4)
    if len(result.flights) <= MOST_FLIGHTS:
        panel.legend(frameon=False, fontsize=8, loc="lower left", ncols=3, bbox_to_anchor=(0.0, 1.07))
    drawing.plain(panel, "Where the information comes from", "share of each flight (%)", "")
    return figure


def _convergence(result: Identification) -> "Figure":
    record = result.solution.record
    here = drawing.look()
    figure, axes = drawing.figure(1, 2, (12.0, 3.8))
    number = np.arange(1, len(record) + 1)
    panel = axes[0, 0]
    panel.semilogy(number, [max(i.step_sigma, 1e-6) for i in record], "o-", color=here.colours[1], linewidth=1.6)
    panel.axhline(CONVERGED_SIGMA, color=here.ink, linewidth=0.8, linestyle="--")
    panel.text(1.0, 1.15 * CONVERGED_SIGMA, "small enough", fontsize=8, color=here.ink)
    drawing.readable_log(panel)
    drawing.plain(panel, "Largest step of a parameter", "iteration", "standard errors")
    panel = axes[0, 1]
    styles = ("-", "--", ":")
    for i, e in enumerate(e for e in result.parameters if e.status == "free"):
        path = np.array([r.values[i] for r in record if len(r.values) == len(record[-1].values)])
        if abs(e.value) > 0.0 and not e.name.startswith("pose_sensor"):
            colour = here.colours[i % len(here.colours)]
            style = styles[i // len(here.colours) % len(styles)]
            whole = len(path) == len(record)  # else a parameter was held on the way, and what came before is left out
            values = (np.concatenate([[e.start], path]) if whole else path) / e.value
            panel.plot(
                np.arange(len(record) + 1 - len(values), len(record) + 1),
                values,
                style,
                color=colour,
                linewidth=1.3,
                label=e.name,
            )
    panel.legend(frameon=False, fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
    drawing.plain(panel, "Each parameter over its final value (0: where it started)", "iteration", "ratio")
    return figure


def _correlation(result: Identification) -> "Figure":
    names = result.free_names
    size = 0.36 * len(names) + 2.6
    figure, axes = drawing.figure(1, 1, (size + 1.0, size))
    panel = axes[0, 0]
    image = panel.imshow(result.correlation, vmin=-1.0, vmax=1.0, cmap="RdBu_r")
    panel.set_xticks(range(len(names)), names, rotation=90, fontsize=8)
    panel.set_yticks(range(len(names)), names, fontsize=8)
    for i, row in enumerate(result.correlation):
        for j, value in enumerate(row):
            if i != j and abs(value) >= 0.3:
                colour = "white" if abs(value) > 0.7 else drawing.CELL_INK
                panel.text(j, i, f"{value:.2f}", ha="center", va="center", fontsize=7, color=colour)
    panel.set_title("Correlation of the estimates", loc="left", fontsize=10)
    figure.colorbar(image, ax=panel, shrink=0.7)
    return figure
