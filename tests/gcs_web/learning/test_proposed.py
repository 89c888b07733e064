"""The proposed next flight on disk, and the level cut through the map under its picture."""

import shutil
from pathlib import Path

import numpy as np
import pytest

import esdf
import mapping
from esdf import Edit
from esdf.solids import Box
from flight import project
from gcs_web.learning import proposed
from gcs_web.protocol.next_flight import NextFlight


@pytest.mark.parametrize("clearance_m", [0.0, 0.3, 0.6])
def test_a_section_has_room_where_the_map_has_the_clearance(pillar_map: Path, clearance_m):
    field = mapping.open_map(pillar_map).field
    cut = proposed.section(field, 1.2, clearance_m)
    at = np.array([[0.8, 0.8], [3.0, 2.0], [2.0, 1.5], [4.0, 2.6], [0.1, 3.0]])  # two of them are pillars
    place = ((at - cut.low_m) // cut.cell_m).astype(int)
    drawn = [cut.rows[row][column] == "." for column, row in place]
    centre_m = np.array(cut.low_m) + (place + 0.5) * cut.cell_m
    distance_m = field.distance(np.column_stack([centre_m, np.full(5, 1.2)]))
    assert drawn == (np.nan_to_num(distance_m, nan=-1.0) >= clearance_m).tolist()
    assert drawn[2:4] == [False, False]
    assert max(len(cut.rows), len(cut.rows[0])) == proposed.CELLS


def test_what_was_proposed_is_read_again_and_what_cannot_be_read_is_none(tmp_path: Path):
    (tmp_path / ".session").mkdir()
    assert proposed.load(tmp_path).state == "none"
    found = NextFlight("current", name="next", path_m=[0.0, 1.0, 2.0])
    proposed.save(tmp_path, found)
    assert proposed.load(tmp_path) == found
    proposed.file(tmp_path).write_text('{"state": "curr')
    assert proposed.load(tmp_path).state == "none"


def test_an_edit_of_the_map_makes_the_proposal_one_of_another_map(pillar_map: Path, tmp_path: Path):
    opened = project.create(tmp_path / "project", "edited")
    assert proposed.map_hash(opened) == ""
    shutil.copytree(pillar_map, opened.map, dirs_exist_ok=True)
    before = proposed.map_hash(opened)
    post = Edit("add", Box((2.0, 1.5, 0.0), (2.2, 1.7, 2.0)))
    esdf.save_edits(opened.map / "esdf" / "edits.json", [post])
    edited = proposed.map_hash(opened)
    assert "" != before != edited
    esdf.save_edits(opened.map / "esdf" / "edits.json", [post, post])
    assert proposed.map_hash(opened) not in (before, edited)
