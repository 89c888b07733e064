"""Incremental mapping: a map grows instant by instant. Runs in a child process only (see `child`)."""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

_GROWN = 1.3
"""Everything is adjusted together when instants or points are so many times as many as they were the last time. All
these adjustments then take a fixed multiple of the last one's work; at a ratio of 1.1 twice as much as at 1.3."""
_RELAXATIONS = 2
_ANY_PAIR = (-1, -1)
"""In place of the numbers of two images: COLMAP searches for them."""
_MOST_DIRECT = 20_000
"""Images that COLMAP may adjust together by factoring the sparse normal equations, which are a band along a path. By
itself it solves them iteratively beyond 1,000 images: 500 images then already take more than five times as long."""


def largest_model(database: Path, options: Any, start: Any, placed: Callable[[], None]) -> Any:
    """The largest of the maps that the images give; each starts with two instants that no other has.

    Steps and order are COLMAP's (Schönberger and Frahm, "Structure-from-motion revisited", 2016). Its own loop has no
    option for the solver of the adjustments, and in the end adjusts everything twice.

    Args:
        database: COLMAP's, with features and matches.
        options: `pycolmap.IncrementalPipelineOptions`.
        start: COLMAP's model, which is grown in place before others are begun, or None.
        placed: called after each instant that is placed in a map begun before.

    Returns:
        COLMAP's model with the rig in its true size; None if no two instants could be placed against each other.
    """
    import pycolmap

    with pycolmap.Database.open(database) as opened:
        pipeline = pycolmap.IncrementalPipeline(options, opened, pycolmap.ReconstructionManager())
    cache = pipeline.database_cache
    mapper = pycolmap.IncrementalMapper(cache)
    kept: list[Any] = []
    likely = _likely_pairs(database, options.get_mapper())
    if start is not None:
        mapper.begin_reconstruction(start)
        _grow(mapper, options, placed)
        mapper.end_reconstruction(discard=False)
        kept.append(start)
    for starting in _relaxed(options):
        mapper.reset_initialization_stats()
        # images that are in no map yet make no larger one if they are too few
        while cache.num_images() - mapper.num_total_reg_images() > max(map(_images, kept), default=1):
            taken = {image for model in kept for image in model.reg_image_ids()}
            model = _begun(pipeline, mapper, starting, (pair for pair in likely if taken.isdisjoint(pair)))
            if model is None:
                break
            _grow(mapper, options, placed)
            is_kept = not kept or _images(model) >= options.min_model_size
            mapper.end_reconstruction(discard=not is_kept)  # other maps can then start with its images
            kept += [model] * is_kept
    if not kept:
        return None
    largest = max(kept, key=_images)
    pycolmap.align_reconstruction_to_orig_rig_scales(cache.rigs, largest)  # COLMAP scales maps and rigs as they grow
    return largest


def _images(model: Any) -> int:
    return model.num_reg_images()


def _relaxed(options: Any) -> Iterator[Any]:
    """What two instants must have in common to start a map: first as stated, then fewer matches and less parallax."""
    starting = options.get_mapper()
    yield starting
    for _ in range(_RELAXATIONS):
        starting.init_min_num_inliers //= 2
        yield starting
        starting.init_min_tri_angle /= 2.0
        yield starting


def _likely_pairs(database: Path, starting: Any) -> Iterator[tuple[int, int]]:
    """Numbers of two images of different instants whose verified matches are enough and show enough parallax.

    In the order of COLMAP's own search: first those of the image with most matches. That search estimates each pair's
    geometry anew, most of it of neighbours with little parallax: 7 of 10 CPU s in which 20 pairs of images were placed.
    """
    import pycolmap

    with pycolmap.Database.open(database) as opened:
        instants = {image.image_id: image.frame_id for image in opened.read_all_images()}
        numbers, counts = opened.read_two_view_geometry_num_inliers()
        pairs = [pycolmap.pair_id_to_image_pair(number) for number in numbers]
        totals = dict.fromkeys(instants, 0)
        for pair, count in zip(pairs, counts, strict=True):
            for image in pair:
                totals[image] += count
        ranked = [(-max(totals[a], totals[b]), -count, a, b) for (a, b), count in zip(pairs, counts, strict=True)]
        for _, fewer, a, b in sorted(ranked):
            is_enough = -fewer >= starting.init_min_num_inliers and instants[a] != instants[b]
            if is_enough and _parallax_deg(opened, a, b) > starting.init_min_tri_angle:
                yield a, b


def _parallax_deg(database: Any, a: int, b: int) -> float:
    """Median angle between the rays of two images to what they match; 0 where the matches do not tell."""
    import pycolmap

    geometry = database.read_two_view_geometry(a, b)
    cameras = [database.read_camera(database.read_image(image).camera_id) for image in (a, b)]
    pixels = [database.read_keypoints(image)[:, :2] for image in (a, b)]
    is_known = pycolmap.estimate_two_view_geometry_pose(cameras[0], pixels[0], cameras[1], pixels[1], geometry)
    return math.degrees(geometry.tri_angle) if is_known else 0.0


def _begun(pipeline: Any, mapper: Any, starting: Any, likely: Iterable[tuple[int, int]]) -> Any:
    """A map of two instants, which the mapper goes on with; None if no two that are in no map are good enough.

    Args:
        likely: pairs of images that are tried before COLMAP searches among all.
    """
    import pycolmap

    for pair in itertools.chain(likely, itertools.repeat(_ANY_PAIR, pipeline.options.init_num_trials)):
        pipeline.options.init_image_id1, pipeline.options.init_image_id2 = pair
        model = pycolmap.Reconstruction()
        mapper.begin_reconstruction(model)
        status = pipeline.initialize_reconstruction(mapper, starting, model)
        if status == pycolmap.IncrementalPipelineStatus.SUCCESS:
            return model
        mapper.end_reconstruction(discard=True)
        if status == pycolmap.IncrementalPipelineStatus.NO_INITIAL_PAIR:
            break
    return None


def _grow(mapper: Any, options: Any, placed: Callable[[], None]) -> None:
    """Place all instants that can be placed; adjust everything together from time to time, and in the end."""
    is_adjusted, adjusted = False, _size(mapper)
    while True:
        is_placed = mapper.num_shared_reg_images() < options.max_model_overlap and _place_next(mapper, options)
        if is_placed:
            placed()
        elif is_adjusted:
            return
        is_adjusted = not is_placed or _has_grown(_size(mapper), adjusted)  # more may fit into the adjusted map
        if is_adjusted:
            adjust(mapper, options)
            mapper.filter_frames(options.get_mapper())
            adjusted = _size(mapper)


def _size(mapper: Any) -> tuple[int, int]:
    """Instants and points."""
    return mapper.reconstruction.num_reg_frames(), mapper.reconstruction.num_points3D()


def _has_grown(size: Sequence[int], adjusted: Sequence[int]) -> bool:
    return any(now >= _GROWN * before for now, before in zip(size, adjusted, strict=True))


def _place_next(mapper: Any, options: Any) -> bool:
    """Place the instant whose image sees most of the map, with the points that it adds; adjust what is near it."""
    choosing, triangulating = options.get_mapper(), options.get_triangulation()
    # placing an image without common 3D points once turned the last instants by 19 degrees, with no warning
    for image_id in mapper.find_next_images(choosing, structure_less=False):
        if mapper.register_next_image(choosing, image_id):
            for image in mapper.reconstruction.image(image_id).frame.image_ids:
                mapper.triangulate_image(triangulating, image.id)
            mapper.iterative_local_refinement(
                options.ba_local_max_refinements,
                options.ba_local_max_refinement_change,
                choosing,
                options.get_local_bundle_adjustment(),
                triangulating,
                image_id,
            )
            return True
    return False


def adjust(mapper: Any, options: Any, *, normalize: bool = True) -> None:
    """Adjust everything together, and triangulate, complete, merge and drop points, until little changes."""
    adjusting = options.get_global_bundle_adjustment()
    adjusting.ceres.max_num_images_direct_sparse_cpu_solver = _MOST_DIRECT
    mapper.iterative_global_refinement(
        options.ba_global_max_refinements,
        options.ba_global_max_refinement_change,
        options.get_mapper(),
        adjusting,
        options.get_triangulation(),
        normalize_reconstruction=normalize,
    )
