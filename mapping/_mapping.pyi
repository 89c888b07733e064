"""Mapping kernels. Contiguous arrays in, new arrays out; see `mapping/src/module.cpp`."""

import numpy as np
from numpy.typing import NDArray

BRICK_SIZE: int

def rectify(
    image: NDArray[np.uint8],
    lens: NDArray[np.float64],
    R_camera_grid: NDArray[np.float64],
    grid: NDArray[np.float64],
) -> NDArray[np.uint8]: ...
def inverse_range(
    disparity: NDArray[np.int16],
    nearest: NDArray[np.int16],
    grid: NDArray[np.float64],
    R_camera_grid: NDArray[np.float64],
    baseline_m: float,
    T_partner_camera: NDArray[np.float64],
    partner: NDArray[np.float64],
    rays: NDArray[np.float64],
    disparity_std_px: float,
    largest_relative_std: float,
    deviations: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]: ...
def nearest_disparity(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    disparity: NDArray[np.int16],
    disparities: int,
    noise: float,
    deviations: float,
    mean: float,
) -> NDArray[np.int16]: ...
def sweep_lines(
    first: NDArray[np.float64],
    last: NDArray[np.float64],
    partner_first: NDArray[np.float64],
    partner_last: NDArray[np.float64],
    partner: NDArray[np.int32],
    offset_m: NDArray[np.float64],
    std_rad: float,
    tolerance: float,
    nearest_m: float,
    farthest_m: float,
    largest_relative_std: float,
    least_overlap: float,
    threads: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.uint8], NDArray[np.uint8]]: ...
def carve(
    origin_world_m: NDArray[np.float64],
    voxel_m: float,
    seen_through: NDArray[np.uint8],
    bound: NDArray[np.float32],
    lens: NDArray[np.float64],
    T_camera_world: NDArray[np.float64],
    margin_m: float,
    farthest_m: float,
    enough: int,
    threads: int,
) -> None: ...
def fuse(
    values: NDArray[np.float32], deviations: NDArray[np.float32], tolerance: float, least: int
) -> tuple[NDArray[np.float32], NDArray[np.float32]]: ...
def facing(
    inverse_range: NDArray[np.float32], rays: NDArray[np.float64], step: int, unsure: float
) -> NDArray[np.float32]: ...
def mark_near_surface(
    origin_world_m: NDArray[np.float64],
    voxel_m: float,
    shape: tuple[int, int, int],
    near: NDArray[np.uint8],
    inverse_range: NDArray[np.float32],
    facing: NDArray[np.float32],
    lens: NDArray[np.float64],
    rays: NDArray[np.float64],
    T_world_camera: NDArray[np.float64],
    truncation_m: float,
    farthest_m: float,
) -> None: ...
def integrate(
    origin_world_m: NDArray[np.float64],
    voxel_m: float,
    shape: tuple[int, int, int],
    bricks: NDArray[np.int32],
    distance: NDArray[np.float32],
    weight: NDArray[np.float32],
    scatter: NDArray[np.float32],
    images: NDArray[np.uint8],
    colour: NDArray[np.float32],
    colour_weight: NDArray[np.float32],
    inverse_range: NDArray[np.float32],
    deviation: NDArray[np.float32],
    facing: NDArray[np.float32],
    pixels: NDArray[np.uint8],
    lens: NDArray[np.float64],
    T_camera_world: NDArray[np.float64],
    truncation_m: float,
    farthest_m: float,
    threads: int,
) -> None: ...
def marching_cubes(
    origin_world_m: NDArray[np.float64],
    voxel_m: float,
    shape: tuple[int, int, int],
    bricks: NDArray[np.int32],
    distance: NDArray[np.float32],
    weight: NDArray[np.float32],
    scatter: NDArray[np.float32],
    images: NDArray[np.uint8],
    colour: NDArray[np.float32],
    colour_weight: NDArray[np.float32],
    least_weight: float,
) -> tuple[
    NDArray[np.float64],
    NDArray[np.int32],
    NDArray[np.float32],
    NDArray[np.float32],
    NDArray[np.float32],
    NDArray[np.uint8],
]: ...
def surface_ranges(
    origin_world_m: NDArray[np.float64],
    voxel_m: float,
    number: NDArray[np.int32],
    filled: NDArray[np.uint8],
    plane: NDArray[np.float64],
    rays: NDArray[np.float64],
    T_world_camera: NDArray[np.float64],
    farthest_m: float,
) -> NDArray[np.float32]: ...
def match_through_surface(
    grey: NDArray[np.uint8],
    range_m: NDArray[np.float32],
    lens: NDArray[np.float64],
    rays: NDArray[np.float64],
    partner_grey: NDArray[np.uint8],
    partner_range_m: NDArray[np.float32],
    partner_lens: NDArray[np.float64],
    T_partner_camera: NDArray[np.float64],
    step: int,
) -> NDArray[np.float32]: ...
def compare_through_surface(
    counts: NDArray[np.uint8],
    grey: NDArray[np.uint8],
    range_m: NDArray[np.float32],
    lens: NDArray[np.float64],
    rays: NDArray[np.float64],
    least: NDArray[np.uint8],
    most: NDArray[np.uint8],
    partner_range_m: NDArray[np.float32],
    partner_lens: NDArray[np.float64],
    T_partner_camera: NDArray[np.float64],
    gain: NDArray[np.float32],
    step: int,
    allowed: float,
    enough: int,
) -> None: ...
def count_looks(
    origin_world_m: NDArray[np.float64],
    voxel_m: float,
    marked: NDArray[np.uint8],
    looks: NDArray[np.uint8],
    contradictions: NDArray[np.uint8],
    verdict: NDArray[np.uint8],
    range_m: NDArray[np.float32],
    lens: NDArray[np.float64],
    T_camera_world: NDArray[np.float64],
    nearest_m: float,
    farthest_m: float,
    margin_m: float,
    least_tested: float,
    least_pixels: int,
    least_share: float,
    least_rate: float,
    threads: int,
) -> None: ...
