"""How `goshawk preflight` and `goshawk preflight batch` fly, as options: how often, in what air, with what errors."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import click

import preflight
from goshawk.commands.preflight import inputs
from goshawk.commands.preflight.like import Like
from goshawk.terminal import console, outputs
from goshawk.terminal.records import options_as
from preflight import core
from vehicle import Vehicle

_DEFAULT = preflight.Uncertainty()
_OPTIONS = (
    click.option(
        "--flights", type=int, help="Flights to count [default: as many as can show --risk]; of a --rare level."
    ),
    click.option(
        "--rare", is_flag=True, help="Estimate by levels of ever nearer flights [default: for risks below 0.001]."
    ),
    click.option("--risk", type=float, default=1e-3, show_default=True, help="Probability of a loss that is accepted."),
    console.gust_option("none, or as of --like"),
    click.option(
        "--thermals",
        "thermal_std_m_s",
        type=click.FloatRange(0.0, 10.0),
        default=0.0,
        show_default=True,
        help="Vertical wind at 10 m height, m/s: its standard deviation; less below.",
    ),
    click.option(
        "--like",
        "like_files",
        type=click.Path(path_type=Path),
        multiple=True,
        help="Flight whose log tells gaps and noise of pose and gyro, and by its observer wind and gusts. Repeatable.",
    ),
    click.option(
        "--pose-delay",
        "pose_delay_s",
        type=click.FloatRange(0.0, 0.1),
        help="Delay of the pose, untold, s: its standard deviation [default: the model's, or 0.003].",
    ),
    click.option(
        "--drop-outs",
        "drop_outs_per_s",
        type=click.FloatRange(0.0, 10.0),
        help="Gaps of the pose a second, each of --drop-out-time [default: none].",
    ),
    click.option(
        "--drop-out-time",
        "drop_out_s",
        type=click.FloatRange(0.0, 5.0),
        help="Length of a gap of the pose, s [default: 0.1].",
    ),
    click.option(
        "--localization",
        "localization_std_m",
        type=click.FloatRange(0.0, 1.0),
        help="Standard deviation of the pose in the map, metres, each axis [default: 0.02, and what the map states].",
    ),
    click.option(
        "--pose-jump",
        "pose_jump_std_m",
        type=click.FloatRange(0.0, 5.0),
        default=0.0,
        show_default=True,
        help="Lasting jump of the pose at some moment of every flight, m: its standard deviation.",
    ),
    click.option(
        "--pose-outside",
        is_flag=True,
        help="The pose is not one in the map (motion capture): a wrong scale moves its walls.",
    ),
    click.option(
        "--motor-fault",
        "motor_fault_ratio",
        type=click.FloatRange(0.0, 1.0),
        default=0.0,
        show_default=True,
        help="Share of its thrust that one rotor loses at some moment of every flight.",
    ),
    click.option(
        "--battery",
        "battery_v",
        type=click.FloatRange(0.0),
        help="Lowest battery voltage at the start [default: full].",
    ),
    click.option(
        "--rate", "rate_hz", type=int, help=f"Steps of the controller a second [default: {core.RATE_HZ}, assumed]."
    ),
    click.option("--seed", type=click.IntRange(0, 2**32 - 1), default=0, show_default=True, help="Seed: of all noise."),
    outputs.overwrite_option,
)


@dataclass(frozen=True, slots=True)
class Asked:
    """Values of the options."""

    flights: int | None
    rare: bool
    risk: float
    gust_std_m_s: float | None
    thermal_std_m_s: float
    like_files: tuple[Path, ...]
    pose_delay_s: float | None
    drop_outs_per_s: float | None
    drop_out_s: float | None
    localization_std_m: float | None
    pose_jump_std_m: float
    pose_outside: bool
    motor_fault_ratio: float
    battery_v: float | None
    rate_hz: int | None
    seed: int
    overwrite: bool

    def like(self, models: Mapping[Path, Vehicle], wind: str | None) -> Like:
        """What the flights of `--like` tell and no option gives.

        Args:
            models: by their files.
            wind: as `--wind` takes it; None: not given.

        Raises:
            InputError: a flight is missing, or tells nothing.
            FormatError: one cannot be read.
        """
        air = [*(["wind_m_s"] if wind is None else []), *(["gust_std_m_s"] if self.gust_std_m_s is None else [])]
        return Like.of(self.like_files, self.drop_outs_per_s, self.drop_out_s, models=models, air=air)

    def flown(self, wind: str | None = None, like: Like | None = None) -> preflight.Options:
        """How to fly in a wind as `--wind` takes it, or the flights'.

        What the map says of itself is not in it yet (`inputs.of_map`).

        Raises:
            InputError: the wind, the rate or another number makes no sense.
        """
        like = like or Like()
        uncertainty = replace(
            like.blowing if wind is None else inputs.blowing(wind),
            gust_std_m_s=like.gust_std_m_s if self.gust_std_m_s is None else self.gust_std_m_s,
            thermal_std_m_s=self.thermal_std_m_s,
            pose_delay_std_s=self.pose_delay_s,
            drop_outs_per_s=like.drop_outs_per_s if self.drop_outs_per_s is None else self.drop_outs_per_s,
            drop_out_s=like.drop_out_s if self.drop_out_s is None else self.drop_out_s,
            localization_std_m=self.localization_std_m,
            pose_jump_std_m=self.pose_jump_std_m,
            pose_of_map=not self.pose_outside,
            motor_fault_ratio=self.motor_fault_ratio,
            battery_v=self.battery_v,
        )
        return preflight.Options(
            self.flights,
            self.risk,
            self.seed,
            uncertainty,
            rate_hz=self.rate_hz,
            sensors=like.sensors,
            rare=self.rare or None,
        )


preflight_options = options_as(Asked, _OPTIONS)
"""A decorator that gives a verb these options; their values reach it as one argument `asked`."""
