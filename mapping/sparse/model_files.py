"""A sparse model on disk, for the stages of a map: `read` returns what was given to `write`."""

import json
from pathlib import Path

import numpy as np

from mapping.camera import rig as rigs
from mapping.camera.trial import Finding, Trial
from mapping.sparse.calibration.calibration import SparseModel

_ARRAYS = ("T_world_body", "registered", "points_world", "descriptors", "observations", "pixels", "breaks", "overlaps")
_NUMBERS = ("reprojection_error_px", "least_agreement", "repeated", "by_motion", "motion_notes", "clocks", "cpu_s")


def write(folder: Path, model: SparseModel) -> None:
    """Write a model into an existing folder."""
    trial = model.trial
    arrays = {name: getattr(model, name) for name in _ARRAYS}
    trial_arrays = {"trial_T_world_body": trial.T_world_body, "trial_points_world": trial.points_world}
    if trial.shape_std is not None:
        trial_arrays["trial_shape_std"] = trial.shape_std
    np.savez(folder / "arrays.npz", allow_pickle=False, **arrays, **trial_arrays)
    rigs.save(folder / "camera.toml", model.rig)
    rigs.save(folder / "trial_camera.toml", trial.rig)
    numbers = {name: getattr(model, name) for name in _NUMBERS}
    findings = [finding.as_dict() for finding in trial.findings]
    numbers["tracked_body"] = {kind: T.tolist() for kind, T in model.tracked_body.items()}
    numbers |= {"noise_px": trial.noise_px, "scale_std": trial.scale_std, "findings": findings}
    numbers["growth"] = trial.growth
    (folder / "numbers.json").write_text(json.dumps(numbers))


def read(folder: Path) -> SparseModel:
    """Read what `write` wrote."""
    numbers = json.loads((folder / "numbers.json").read_text())
    with np.load(folder / "arrays.npz", allow_pickle=False) as kept:
        arrays = {name: kept[name] for name in kept.files}
    trial = Trial(
        findings=tuple(Finding.from_dict(finding) for finding in numbers["findings"]),
        rig=rigs.load(folder / "trial_camera.toml"),
        T_world_body=arrays["trial_T_world_body"],
        points_world=arrays["trial_points_world"],
        noise_px=numbers["noise_px"],
        scale_std=numbers["scale_std"],
        shape_std=arrays.get("trial_shape_std"),
        growth=numbers.get("growth", 1.0),
    )
    return SparseModel(
        rig=rigs.load(folder / "camera.toml"),
        trial=trial,
        tracked_body={kind: np.array(T) for kind, T in numbers["tracked_body"].items()},
        **{name: arrays[name] for name in _ARRAYS},
        **{name: numbers[name] for name in _NUMBERS},
    )
