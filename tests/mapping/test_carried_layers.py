"""What is in a voxel with what probability, and which image sees which point, go along with a map that is made new."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import esdf
from esdf import FREE, OCCUPIED, Field, Grid
from flight import FormatError, frames, rotations
from mapping import map_parts, merging
from mapping.dense import occupancy
from mapping.map_parts import MapParts
from mapping.merging import Registration
from mapping.sparse import tracks
from mapping.sparse.tracks import Tracks
from tests.mapping.test_map_copies import half, room

Seen = set[tuple[tuple[float, ...], str, int, float]]


def field(first: tuple[int, int, int], state: np.ndarray) -> Field:
    return esdf.build(state, Grid(tuple(0.1 * np.array(first, float)), (0.1, 0.1, 0.1), state.shape))


def stated(shape: tuple[int, ...], seed: int) -> np.ndarray:
    values = np.random.default_rng(seed).uniform(0.0, 0.2, shape).astype(np.float16)
    values[np.random.default_rng(seed + 1).random(shape) < 0.2] = np.nan
    return values


def test_a_turned_layer_has_at_each_place_what_it_had_there() -> None:
    old, values = field((0, 0, 0), np.full((6, 4, 3), FREE, np.uint8)), stated((6, 4, 3), 1)
    T = frames.transform(rotations.from_yaw(np.pi / 2), np.array([1.0, 0.5, 0.0]))
    new = field((4, 3, -1), np.full((12, 12, 6), FREE, np.uint8))
    found = occupancy.moved(values, old, T, new)
    for cell in np.ndindex(*values.shape):
        place = frames.apply(T, old.grid.centre(np.array([cell])))
        at = found[tuple(new.grid.index(place)[0])]
        np.testing.assert_equal(at, values[cell])
    assert np.isfinite(found).sum() == np.isfinite(values).sum()


def test_of_two_layers_the_larger_holds_and_none_where_something_stands() -> None:
    first, second = np.full((3, 1, 1), FREE, np.uint8), np.full((3, 1, 1), FREE, np.uint8)
    second[2] = OCCUPIED
    a, b = np.array([0.1, 0.3, np.nan], np.float16), np.array([0.2, np.nan, np.nan], np.float16)
    parts = [field((0, 0, 0), first), field((1, 0, 0), second)]
    both = field((0, 0, 0), np.array([FREE, FREE, FREE, OCCUPIED], np.uint8).reshape(4, 1, 1))
    found = occupancy.joined(both, [(a.reshape(3, 1, 1), parts[0]), (b.reshape(3, 1, 1), parts[1])])
    assert found is not None
    np.testing.assert_array_equal(found[:, 0, 0], np.array([0.1, 0.3, np.nan, np.nan], np.float16))
    alone = occupancy.joined(both, [(None, parts[0]), (b.reshape(3, 1, 1), parts[1])])
    assert alone is not None
    np.testing.assert_array_equal(alone[:, 0, 0], np.array([np.nan, 0.2, np.nan, np.nan], np.float16))
    assert occupancy.joined(both, [(None, parts[0]), (None, parts[1])]) is None


def whole(name: str = "room", seed: int = 0) -> MapParts:
    """The room, each point seen by one or two of its three images."""
    made = room(name, seed=seed)
    points = np.arange(len(made.known.points_world_m))
    index = np.concatenate(
        [np.column_stack([points, points % 3, 0 * points]), np.column_stack([points, points % 2, 0 * points])]
    )
    pixels = np.random.default_rng(seed).uniform(0.0, 64.0, (len(index), 2)).astype(np.float32).astype(float)
    values = stated(made.field.grid.shape, 5)
    values[made.field.state != FREE] = np.nan
    return dataclasses.replace(made, occupancy=values, tracks=Tracks(index.astype(np.int32), pixels))


def seen(parts: MapParts) -> Seen:
    return {
        (tuple(parts.known.points_world_m[p].round(6)), parts.images[i], int(c), round(float(u), 3))
        for (p, i, c), (u, _) in zip(parts.tracks.index, parts.tracks.pixels, strict=True)
    }


def test_both_come_back_from_a_folder_and_are_the_parts_own_in_a_cropped_map(tmp_path: Path) -> None:
    given = whole()
    map_parts.write(tmp_path / "map", given)
    back = map_parts.read(tmp_path / "map")
    assert back.occupancy is not None
    np.testing.assert_array_equal(back.occupancy, given.occupancy)
    np.testing.assert_array_equal(back.tracks.index, given.tracks.index)
    np.testing.assert_array_equal(back.tracks.pixels, given.tracks.pixels)
    part = half(given, 2.0, 7.0)
    assert part.occupancy is not None
    known = np.argwhere(np.isfinite(part.occupancy))
    there = given.field.grid.index(part.field.grid.centre(known))
    assert given.occupancy is not None
    np.testing.assert_array_equal(part.occupancy[tuple(known.T)], given.occupancy[tuple(there.T)])
    assert (part.field.state[tuple(known.T)] == FREE).all()
    left = seen(part)
    assert left
    assert left == {
        one
        for one in seen(given)
        if one[0] in {tuple(p.round(6)) for p in part.known.points_world_m} and one[1] in part.images
    }
    (tmp_path / "map" / occupancy.FILE).unlink()
    (tmp_path / "map" / "localization" / tracks.FILE).unlink()
    earlier = map_parts.read(tmp_path / "map")
    assert earlier.occupancy is None
    assert not len(earlier.tracks.index)


def test_both_are_in_a_joined_map_with_the_numbers_of_its_points_and_images() -> None:
    first, second = whole("west"), whole("east", seed=1)
    second = dataclasses.replace(second, edits=())
    pairs = np.column_stack([np.arange(100), np.arange(100)])
    found = Registration(np.eye(4), pairs, 100, 0.0, 1.0, 1.0, 0.0)
    both = merging.merged(first, second, found)
    assert both.occupancy is not None
    assert first.occupancy is not None
    free = both.field.state == FREE
    assert (np.isfinite(both.occupancy) <= (both.field.state != OCCUPIED)).all()
    assert np.isfinite(both.occupancy[free]).mean() > 0.7
    names = set(both.images)
    own = seen(first)
    assert own <= seen(both)
    again = seen(both) - own
    assert {image for _, image, _, _ in again} <= names - set(first.images)
    kept = second.tracks.index[:, 0] >= 100  # the others are points of the first map
    assert len(again) == len(
        {
            (*row, u)
            for row, (u, _) in zip(map(tuple, second.tracks.index[kept]), second.tracks.pixels[kept], strict=True)
        }
    )


@pytest.mark.parametrize("row", [[900, 0, 0], [0, 3, 0], [0, 0, 1], [-1, 0, 0]])
def test_tracks_of_another_map_are_refused(tmp_path: Path, row: list[int]) -> None:
    tracks.save(tmp_path, Tracks(np.array([row], np.int32), np.zeros((1, 2))))
    with pytest.raises(FormatError, match="not of this map's points and images"):
        tracks.load(tmp_path, 900, 3, 1)
    (tmp_path / tracks.FILE).write_bytes(b"PK\x03\x04")
    with pytest.raises(FormatError, match="damaged"):
        tracks.load(tmp_path, 900, 3, 1)
