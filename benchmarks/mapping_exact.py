"""Exact camera files: how often is one corrected or the map doubted, and how far is a long corridor from the truth?

    python benchmarks/mapping_exact.py --seeds 40                  stereo and front-down rigs, in rooms and a corridor
    python benchmarks/mapping_exact.py --corridors 60 80 100       positions in long corridors, and what the map states
    python benchmarks/mapping_exact.py --field 0.07                with a smooth error of each camera

The matches are made by formula from the exact rig, with white noise. A lens model that nearly fits leaves a smooth
error over the image, which all images of a camera share: `--field` is its RMS on each axis.
"""

import argparse
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import report
from report import Row, row

from flight import FloatArray, frames, rotations
from goshawk.rendered import world as rendered_world
from mapping.camera import rig as rigs
from mapping.camera import trial as trials
from mapping.camera.adjustment import Observations
from mapping.camera.rig import Camera, Rig
from mapping.camera.trial import Trial, Verdict
from mapping.sparse import alignment
from mapping.verdict import SCALE_DOUBT, SHAPE_DOUBT_M, SHIFT_DOUBT_PX, SIGMAS95

NOISE_PX = 0.25
"""Standard deviation of a match on each axis."""
REACH_M, NEAREST_M, IMAGES_OF_A_POINT = 8.0, 0.3, 6.0
WIDTH_M, HEIGHT_M = 2.2, 2.7
"""Of a corridor; a room is 8 m wide and long."""
LEAST_SHARE, MOST_ERROR_M = 0.02, 0.05


@dataclass(frozen=True, slots=True)
class Place:
    """A box whose walls have points, and a path in it with an image every 0.1 s."""

    size_m: FloatArray
    T_world_body: FloatArray


def stereo() -> Rig:
    """Two parallel pinhole cameras, 10 cm apart."""
    cameras = []
    for name, left_m in (("left", 0.05), ("right", -0.05)):
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = rigs.R_BODY_CAMERA_FORWARD, [0.05, left_m, 0.0]
        params = np.array([300.0, 300.0, 240.0, 180.0])
        cameras.append(Camera(name, name, "PINHOLE", 480, 360, params, T, float(np.radians(100.0))))
    return Rig(tuple(cameras))


def corridor(length_m: float, rng: np.random.Generator, step_m: float = 0.4) -> Place:
    """Straight on, swaying a little."""
    x = np.arange(1.5, length_m - 2.5, step_m)
    sway = rng.uniform(0.05, 0.2, 2)
    phase = rng.uniform(0.0, 2 * np.pi, 5)
    position = np.column_stack([
        x, sway[0] * np.sin(0.5 * x + phase[0]), 0.5 * HEIGHT_M + sway[1] * np.sin(0.4 * x + phase[1])
    ])  # fmt: skip
    roll, pitch = 0.05 * np.sin(1.1 * x + phase[4]), 0.05 + 0.04 * np.sin(0.9 * x + phase[3])
    turn = rotations.multiply(
        rotations.from_yaw(0.1 * np.sin(0.7 * x + phase[2])), rotations.exp(np.column_stack([roll, pitch, 0.0 * x]))
    )
    return Place(np.array([length_m, WIDTH_M, HEIGHT_M]), frames.transform(turn, position))


def room(rng: np.random.Generator, instants: int = 40) -> Place:
    """Once round, looking ahead."""
    angle = np.linspace(0.0, 2 * np.pi, instants, endpoint=False) + rng.uniform(0.0, 2 * np.pi)
    radius_m, phase = rng.uniform(1.5, 2.5), rng.uniform(0.0, 2 * np.pi, 3)
    position = np.column_stack([
        4.0 + radius_m * np.cos(angle), radius_m * np.sin(angle), 1.3 + 0.2 * np.sin(3.0 * angle + phase[0])
    ])  # fmt: skip
    tilts = 0.05 * np.sin(2.0 * angle[:, None] + phase[1:])
    turn = rotations.multiply(
        rotations.from_yaw(angle + np.pi / 2), rotations.exp(np.column_stack([tilts, 0.0 * angle]))
    )
    return Place(np.array([8.0, 8.0, HEIGHT_M]), frames.transform(turn, position))


def points_of(place: Place, rng: np.random.Generator) -> FloatArray:
    """(n, 3) on or a little before the walls, floor and ceiling."""
    length_m, width_m, height_m = place.size_m
    area_m2 = 2.0 * (length_m * width_m + length_m * height_m + width_m * height_m)
    count = int(min(12.0 * area_m2, 8000.0))
    point = rng.uniform([0.0, -width_m / 2, 0.0], [length_m, width_m / 2, height_m], (count, 3))
    side = rng.integers(0, 6, count)
    low, high = np.array([0.0, -width_m / 2, 0.0]), np.array([length_m, width_m / 2, height_m])
    before_m = rng.exponential(0.06, count)
    axis = side // 2
    end = np.where(side % 2 == 0, low[axis] + before_m, high[axis] - before_m)
    point[np.arange(count), axis] = end
    return point


def smooth(camera: Camera, rms_px: float, rng: np.random.Generator) -> Callable[[FloatArray], FloatArray]:
    """An error (n, 2) of pixels (n, 2): some waves over the image."""
    waves = 4
    size = rng.normal(size=(2, waves)) * rms_px * np.sqrt(2.0 / waves)
    turn, phase = rng.uniform(0.5, 2.0, (2, waves, 2)), rng.uniform(0.0, 2 * np.pi, (2, waves))

    def error_px(pixels: FloatArray) -> FloatArray:
        place = np.asarray(pixels) / [camera.width, camera.height]
        return np.column_stack([
            (size[k] * np.sin(2 * np.pi * place @ turn[k].T + phase[k])).sum(axis=1) for k in range(2)
        ])  # fmt: skip

    return error_px


def seen(rig: Rig, place: Place, field_px: float, rng: np.random.Generator) -> Observations:
    """What the rig saw of the place, in a map that is centimetres off."""
    T, points = place.T_world_body, points_of(place, rng)
    chances = np.minimum(1.0, IMAGES_OF_A_POINT / np.maximum(1.0, _images_near(T, points)))
    fields = [smooth(camera, field_px, rng) for camera in rig]
    index, pixels = [], []
    for instant, pose in enumerate(T):
        near = np.flatnonzero(rng.random(len(points)) < chances)
        for number, camera in enumerate(rig):
            T_camera = pose @ camera.T_body_camera
            at_camera = (points[near] - T_camera[:3, 3]) @ T_camera[:3, :3]
            found = camera.project(at_camera)
            range_m = np.linalg.norm(at_camera, axis=1)
            inside = camera.contains(found) & (range_m < REACH_M) & (range_m > NEAREST_M)
            if camera.model == "PINHOLE":
                inside &= at_camera[:, 2] > NEAREST_M
            kept = np.flatnonzero(inside)
            index.append(np.column_stack([near[kept], np.full((len(kept), 2), [instant, number])]))
            noise = NOISE_PX * rng.normal(size=(len(kept), 2))
            pixels.append(found[kept] + fields[number](found[kept]) + noise)
    joined, where = np.concatenate(index), np.concatenate(pixels)
    often = np.bincount(joined[:, 0], minlength=len(points))[joined[:, 0]] >= 2
    count = len(T)
    off = frames.transform(rotations.exp(1e-3 * rng.normal(size=(count, 3))), 5e-3 * rng.normal(size=(count, 3)))
    moved = points + 0.02 * rng.normal(size=points.shape)
    return Observations(rig, T @ off, moved, joined[often], where[often], 0.1 * np.arange(count))


def _images_near(T: FloatArray, points: FloatArray) -> FloatArray:
    """(n,) how many images were taken within reach of each point."""
    offsets = points[:, None] - T[None, :, :3, 3]
    return (np.linalg.norm(offsets, axis=2) < 0.5 * REACH_M).sum(axis=1).astype(float)


def doubts(found: Trial, rig: Rig) -> list[str]:
    """Why the verdict of a map of these images alone would doubt it; see `mapping.verdict`."""
    unknown = [
        str(finding.candidate)
        for finding in found.findings
        if finding.verdict is Verdict.UNKNOWN and finding.largest_shift_px > SHIFT_DOUBT_PX
    ]
    if SIGMAS95 * alignment.baseline_std(rig, found.scale_std) > SCALE_DOUBT:
        unknown.append(f"scale +-{100 * SIGMAS95 * found.scale_std:.1f} %")
    if found.shape_std is not None and np.sqrt(np.nanmean(found.shape_std**2)) > SHAPE_DOUBT_M:
        unknown.append("bent")
    return unknown


@dataclass(frozen=True, slots=True)
class Tried:
    """One trial beside the truth."""

    corrected: bool
    why: list[str]
    """It is doubted."""
    off_m: float
    """Mean distance of the positions after the best rigid alignment: with the error of the scale."""
    shape: float
    """RMS distance after the best alignment with a scale, over what is stated."""
    scale: float
    """Error of the scale over its stated standard deviation."""


def aligned(found: FloatArray, true: FloatArray) -> tuple[float, float, float]:
    """Of the positions: mean distance (m) after the best rigid alignment, RMS distance (m) after the best with a scale,
    and that scale (Umeyama, 1991)."""
    a, b = (T[:, :3, 3] - T[:, :3, 3].mean(axis=0) for T in (found, true))
    u, s, vt = np.linalg.svd(b.T @ a)
    flip = np.array([1.0, 1.0, np.sign(np.linalg.det(u @ vt))])
    turned = a @ (u * flip @ vt).T
    scale = float((s * flip).sum() / (a**2).sum())
    left_m = np.linalg.norm(scale * turned - b, axis=1)
    return float(np.linalg.norm(turned - b, axis=1).mean()), float(np.sqrt((left_m**2).mean())), scale


def tried(name: str, rig: Rig, place: Place, field_px: float, rng: np.random.Generator) -> Tried:
    """One trial, and a line of it."""
    started_s = time.process_time()
    found = trials.hold(seen(rig, place, field_px, rng))
    why = doubts(found, rig)
    error_m, bent_m, scale = aligned(found.T_world_body, place.T_world_body)
    stated_m = float("nan") if found.shape_std is None else float(np.sqrt(np.nanmean(found.shape_std**2)))
    corrected = ", ".join(str(f.candidate) for f in found.present)
    print(
        f"{name:20s} {1000 * error_m:6.1f} mm mean; shape {1000 * bent_m:5.1f} of {1000 * stated_m:5.1f} mm; scale "
        f"{100 * (1 / scale - 1):5.2f} of +-{100 * SIGMAS95 * found.scale_std:5.2f} %, "
        f"{time.process_time() - started_s:5.1f} CPU s; "
        f"corrected: {corrected or '-'}; doubted: {', '.join(why) or '-'}",
        flush=True,
    )
    return Tried(bool(found.present), why, error_m, bent_m / stated_m, abs(1 / scale - 1) / found.scale_std)


def exact(seeds: int, field_px: float) -> list[Row]:
    """How many exact files were corrected, and how many maps doubted, in each kind of place."""
    rows: list[Row] = []
    kinds: dict[str, tuple[Rig, Callable[[np.random.Generator], Place]]] = {
        "stereo, room": (stereo(), room),
        "front-down, room": (rendered_world.default_rig(0.75), room),
        "stereo, corridor": (stereo(), lambda rng: corridor(20.0, rng)),
        "front-down, corridor": (rendered_world.default_rig(0.75), lambda rng: corridor(20.0, rng)),
    }
    for number, (name, (rig, make)) in enumerate(kinds.items()):
        results: list[Tried] = []
        for seed in range(seeds):
            rng = np.random.default_rng([seed, number])
            results.append(tried(name, rig, make(rng), field_px, rng))
        for what, share in (
            ("corrected", float(np.mean([r.corrected for r in results]))),
            ("doubted", float(np.mean([bool(r.why) for r in results]))),
        ):
            rows.append(row(f"{name}: {what} ({seeds})", share, "share", f"<= {LEAST_SHARE}", share <= LEAST_SHARE))
        rows += held(f"{name}: ", results)
    return rows


def held(name: str, results: Sequence[Tried]) -> list[Row]:
    """How often the truth is within what is stated at 95 %."""
    shares = {
        "scale within the stated 95 %": float(np.mean([r.scale <= SIGMAS95 for r in results])),
        "shape within twice what is stated": float(np.mean([r.shape <= 2.0 for r in results])),
    }
    return [row(f"{name}{what} ({len(results)})", s, "share", ">= 0.93", s >= 0.93) for what, s in shares.items()]


def long_corridors(lengths_m: Sequence[float], seeds: int, field_px: float) -> list[Row]:
    """Mean error of the positions, or that the map is doubted."""
    rows: list[Row] = []
    results: list[Tried] = []
    for name, rig in (("stereo", stereo()), ("front-down", rendered_world.default_rig(0.75))):
        for length_m in lengths_m:
            for seed in range(seeds):
                rng = np.random.default_rng([seed, int(length_m)])
                label = f"{name}, {length_m:g} m"
                results.append(r := tried(label, rig, corridor(length_m, rng), field_px, rng))
                said = f" (doubted: {', '.join(r.why)})" if r.why else ""
                is_right = r.off_m <= MOST_ERROR_M or bool(r.why)
                rows.append(row(f"{label}, seed {seed}{said}", 1000 * r.off_m, "mm", "<= 50 or doubted", is_right))
    return [*rows, *held("corridors: ", results)]


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--seeds", type=int, default=2)
    arguments.add_argument("--corridors", type=float, nargs="*", default=[], help="lengths, m")
    arguments.add_argument("--field", type=float, default=0.0, help="RMS of a smooth error, px")
    arguments.add_argument("--json", type=Path)
    given = arguments.parse_args()
    rows = (
        long_corridors(given.corridors, given.seeds, given.field)
        if given.corridors
        else exact(given.seeds, given.field)
    )
    report.print_table(rows)
    if given.json:
        report.write(rows, given.json)


if __name__ == "__main__":
    main()
