"""Images without a place are named, and the neighbours between which their overlap was lost."""

import json
from pathlib import Path

import numpy as np
import pycolmap
import pytest

from goshawk.rendered import hall
from goshawk.rendered import scene as rendered_room
from goshawk.rendered import world as rendered_world
from mapping.input.images import ImageSet
from mapping.sparse.mapper import colmap_model, overlap
from mapping.sparse.mapper.overlap import UnplacedRun
from tests.goshawk.running import answer

NAMES = [f"{k}.png" for k in range(10)]


def runs(unplaced: list[int], overlaps: list[tuple[int, int, int]]) -> list[UnplacedRun]:
    placed = ~np.isin(np.arange(len(NAMES)), unplaced)
    return overlap.unplaced_runs(NAMES, placed, np.array(overlaps, int).reshape(-1, 3))


def test_a_map_that_placed_all_has_no_run() -> None:
    assert runs([], [(0, 1, 300)]) == []
    assert overlap.summary([]) == ""


def test_each_run_has_its_neighbours_and_the_matches_across() -> None:
    first, middle, last = runs([0, 4, 5, 9], [(0, 1, 20), (3, 4, 16), (3, 5, 70), (4, 5, 80), (4, 6, 60), (1, 2, 300)])
    assert (first.first, first.last, first.count, first.before, first.after) == ("0.png", "0.png", 1, None, "1.png")
    assert (first.matches_before, first.matches_after) == (0, 20)
    assert (middle.first, middle.last, middle.count) == ("4.png", "5.png", 2)
    assert (middle.before, middle.after) == ("3.png", "6.png")
    assert (middle.matches_before, middle.matches_after) == (16, 0)
    assert (last.first, last.before, last.after, last.matches_before) == ("9.png", "8.png", None, 0)
    assert [run.pieces for run in (first, middle, last)] == [[], [], []]
    assert str(first) == "0.png (verified matches: 20 between 0.png and 1.png)"
    assert str(middle) == "4.png to 5.png (verified matches: 16 between 3.png and 4.png, none between 5.png and 6.png)"


def test_the_first_and_the_last_image_can_be_the_neighbours() -> None:
    assert [(run.before, run.after) for run in runs([1, 8], [])] == [("0.png", "2.png"), ("7.png", "9.png")]


def test_a_piece_overlaps_well_in_itself_and_with_no_placed_image() -> None:
    chain = [(k, k + 1, 100) for k in range(5, 9)]
    (run,) = runs([4, 5, 6, 7, 8, 9], [(4, 5, 99), *chain])
    assert run.pieces == [["5.png", "9.png"]]
    assert str(run).endswith("; 5.png to 9.png form a piece of their own)")
    assert str(runs([5, 6, 7, 8, 9], chain)[0]).endswith("; they form a piece of their own)")
    assert str(runs([5, 6, 7, 8, 9], chain[:3])[0]).endswith("; 5.png to 8.png form a piece of their own)")
    # one weak link makes two pieces, of which two instants are none
    (parted,) = runs([4, 5, 6, 7, 8, 9], [(5, 6, 100), (6, 7, 100), (7, 8, 99), (8, 9, 100)])
    assert parted.pieces == [["5.png", "7.png"]]
    # a blurred image among them is matched past, and a placed one far away is enough to belong to the map
    assert runs([5, 6, 7, 8], [(5, 6, 100), (6, 8, 100)])[0].pieces == [["5.png", "8.png"]]
    assert runs([5, 6, 7, 8, 9], [*chain, (0, 7, 100)])[0].pieces == []


def test_a_piece_that_was_visited_twice_is_named_in_both_runs() -> None:
    links = [(1, 2, 200), (2, 3, 200), (6, 7, 200), (7, 8, 200), (2, 7, 200)]
    first, second = runs([1, 2, 3, 6, 7, 8], links)
    assert (first.pieces, second.pieces) == ([["1.png", "3.png"]], [["6.png", "8.png"]])


def test_a_line_names_the_three_longest_runs_in_order() -> None:
    found = runs([0, 2, 4, 5, 7, 8], [])
    line = overlap.summary(found)
    assert [line.index(f"{name}.png") for name in (0, 4, 7)] == sorted(line.index(f"{name}.png") for name in (0, 4, 7))
    assert "2.png (" not in line
    assert line.endswith(", and 1 shorter")
    assert "shorter" not in overlap.summary(found[:3])


def test_matches_are_summed_over_the_cameras_of_two_instants(tmp_path: Path) -> None:
    rig = rendered_world.default_rig(0.4)
    images = ImageSet(tmp_path, rig, ("a.png", "b.png", "c.png"), np.ones((3, 2), bool), np.full(3, np.nan))
    with pycolmap.Database.open(tmp_path / "database.db") as opened:
        for number, camera in enumerate(rig, start=1):
            opened.write_camera(colmap_model.colmap_camera(camera, camera_id=number), use_camera_id=True)
        number_of = {
            (instant, camera): opened.write_image(
                pycolmap.Image(name=images.relative(instant, camera), keypoints=np.zeros((0, 2)), camera_id=camera + 1)
            )
            for instant, camera in reversed(images.pairs())
        }
        for one, other, count in (
            ((0, 0), (1, 0), 40),
            ((1, 1), (0, 1), 30),
            ((1, 1), (0, 0), 5),
            ((1, 0), (1, 1), 99),  # of one instant
            ((0, 1), (2, 1), 17),
        ):
            geometry = pycolmap.TwoViewGeometry()
            geometry.inlier_matches = np.tile(np.arange(count, dtype=np.uint32)[:, None], (1, 2))
            opened.write_two_view_geometry(number_of[one], number_of[other], geometry)
    assert overlap.of_instants(tmp_path / "database.db", images).tolist() == [[0, 1, 75], [0, 2, 17]]


@pytest.mark.slow
def test_images_of_another_place_and_blank_ones_are_named_with_where_overlap_was_lost(tmp_path: Path) -> None:
    """A flight through the room; images 4 and 5 are blank, 10 to 13 are of the hall instead."""
    rig, flight = rendered_world.default_rig(0.4), rendered_world.loop_flight(18, share=0.22)
    elsewhere = rendered_world.loop_flight(18, share=0.12, through_world_m=hall.LOOP_WORLD_M)
    here = rendered_world.pictures(rig, flight, rendered_room.furnished(), 1)
    there = rendered_world.pictures(rig, elsewhere, hall.furnished(), 2)

    def picture(instant: int, number: int) -> np.ndarray:
        if instant in (4, 5):
            return np.full((rig.cameras[number].height, rig.cameras[number].width), 90, np.uint8)
        return (there if 10 <= instant <= 13 else here)(instant, number)

    folder = rendered_world.write_rendered_sequence(tmp_path / "images", rig=rig, flight=flight, picture=picture)
    ended = answer("map", "build", folder, "--camera", folder / "camera.toml", "--out", tmp_path / "map")
    assert ended.returncode == 0
    said = " ".join((ended.stdout + ended.stderr).split())
    report = json.loads((tmp_path / "map" / "report.json").read_text())
    blank, other = (UnplacedRun(**each) for each in report["unplaced_runs"])
    assert (blank.before, blank.first, blank.last, blank.after) == ("0003.png", "0004.png", "0005.png", "0006.png")
    assert (blank.matches_before, blank.matches_after, blank.pieces) == (0, 0, [])
    assert (other.before, other.first, other.last, other.after) == ("0009.png", "0010.png", "0013.png", "0014.png")
    assert max(other.matches_before, other.matches_after) < 100
    assert other.pieces == [["0010.png", "0013.png"]]
    assert report["reasons"][0] == f"12 of 36 images could not be placed: {blank}, {other}"
    assert said.count(str(blank)) == said.count(str(other)) == 1  # in the reason alone
    fields, rings, images = (report[f"residual_{over}"] for over in ("field", "radius", "time"))
    for field, over_radius, over_time in zip(fields, rings, images, strict=True):
        assert field["camera"] == over_radius["camera"] == over_time["camera"]
        assert np.sum(field["count"]) == sum(over_radius["count"]) == sum(over_time["count"])
        assert len(over_time["image"]) == 12
