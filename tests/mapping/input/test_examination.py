"""What is said of images before any long work: each planted fault named, and none in a clean flight."""

import dataclasses
from pathlib import Path

import cv2
import numpy as np
import pytest

import mapping
from flight import InputError
from goshawk.rendered import world as rendered_world
from mapping.input import examination, images
from mapping.input.examination import Examination

COUNT = 12
RIG = rendered_world.default_rig(0.5)


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> images.ImageSet:
    flight = rendered_world.loop_flight(COUNT, share=0.2)
    folder = tmp_path_factory.mktemp("examined") / "images"
    return images.read_folder(rendered_world.write_rendered_sequence(folder, rig=RIG, flight=flight), RIG)


def copied(sequence: images.ImageSet, folder: Path) -> images.ImageSet:
    """The set again, in a folder where images may be changed."""
    for shot in sequence.pairs():
        path = folder / sequence.relative(*shot)
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(sequence.path(*shot).read_bytes())
    return dataclasses.replace(sequence, folder=folder)


def named(found: Examination) -> dict[str, tuple[str, ...]]:
    return {image.image: image.problems for image in found.images if image.problems}


def test_a_clean_flight_has_no_problem(sequence: images.ImageSet) -> None:
    found = examination.examine(sequence)
    assert found.problems == ()
    assert named(found) == {}
    assert found.images[2].step_s == pytest.approx(1.0 / rendered_world.RATE_HZ)
    assert all(image.matches_before is None or image.matches_before > 20 for image in found.images)


def test_each_bad_image_is_named(sequence: images.ImageSet, tmp_path: Path) -> None:
    changed = copied(sequence, tmp_path)
    for name, change in (
        ("0003", lambda p: cv2.blur(p, (15, 15))),
        ("0005", lambda p: (0.04 * p).astype(np.uint8)),
        ("0008", lambda p: np.clip(8.0 * p.astype(float), 0, 255).astype(np.uint8)),
    ):
        path = tmp_path / "front" / f"{name}.png"
        cv2.imwrite(str(path), change(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)))
    found = named(examination.examine(changed))
    assert "blurred" in found["front/0003.png"]
    assert "too dark" in found["front/0005.png"]
    assert {"too bright", "clipped"} & set(found["front/0008.png"])
    assert not [name for name in found if name.startswith("down")]


def test_an_image_of_another_place_has_little_overlap(sequence: images.ImageSet, tmp_path: Path) -> None:
    changed = copied(sequence, tmp_path)
    noise = cv2.GaussianBlur(np.random.default_rng(0).integers(0, 255, (240, 320), dtype=np.uint8), (0, 0), 2.0)
    cv2.imwrite(str(tmp_path / "down" / "0006.png"), noise)
    assert "little overlap" in named(examination.examine(changed))["down/0006.png"]


def test_exchanged_folders_are_named_and_refused(sequence: images.ImageSet, tmp_path: Path) -> None:
    front, down = RIG.cameras
    swapped = dataclasses.replace(
        RIG, cameras=(dataclasses.replace(front, folder="down"), dataclasses.replace(down, folder="front"))
    )
    found = examination.examine(dataclasses.replace(sequence, rig=swapped))
    assert set(found.exchanged) == {"front", "down"}
    assert "exchanged" in found.problems[-1]
    with pytest.raises(InputError, match="seem to be exchanged"):
        mapping.build_map(sequence.folder, swapped, tmp_path / "map")
    assert not (tmp_path / "map").exists()


def turning(swapped: np.ndarray, ambiguous: np.ndarray, turn_rad: float | np.ndarray = 0.09) -> tuple[str, ...]:
    """Folders named as exchanged where two cameras turn with one body.

    Args:
        swapped: (n,) whether each instant's images are in each other's folder.
        ambiguous: (n,) whether the second camera's turn cannot be told.
        turn_rad: standard deviation of the turns, of all or of each.
    """
    rng, seen = np.random.default_rng(1), {}
    deviation_rad = np.broadcast_to(turn_rad, len(swapped))
    for instant, (is_swapped, is_ambiguous) in enumerate(zip(swapped, ambiguous, strict=True)):
        turn = rng.normal(0.0, deviation_rad[instant], 3)
        for number in range(2):
            taken_by = 1 - number if is_swapped else number
            off = rng.normal(0.0, np.radians(8.0 if is_ambiguous and taken_by == 1 else 0.2), 3)
            seen_turn = RIG.cameras[taken_by].T_body_camera[:3, :3].T @ turn + off
            nothing = np.zeros((0, 3))
            seen[instant, number] = examination._Seen(1.0, 128.0, 0.0, nothing, nothing, turn_rad=seen_turn)
    names = tuple(f"{k:04d}.png" for k in range(len(swapped)))
    present, time_s = np.ones((len(names), 2), bool), np.arange(float(len(names)))
    return examination._exchanged(images.ImageSet(Path("."), RIG, names, present, time_s), seen)


@pytest.mark.parametrize("share", [0.0, 0.5, 0.7])
def test_exchanged_folders_are_named_though_many_turns_are_ambiguous(share: float) -> None:
    ambiguous = np.arange(60) < 60 * share
    assert set(turning(np.ones(60, bool), ambiguous)) == {"front", "down"}
    assert turning(np.zeros(60, bool), ambiguous) == ()


def test_turns_that_fit_every_order_or_none_name_no_folder() -> None:
    none, every = np.zeros(60, bool), np.ones(60, bool)
    for swapped in (none, every):
        assert turning(swapped, none, turn_rad=np.radians(0.1)) == ()
        assert turning(swapped, every) == ()
    one = np.arange(60) == 30
    assert turning(one, none, turn_rad=np.where(one, np.radians(9.0), np.radians(0.1))) == ()


@pytest.mark.parametrize(
    ("swapped", "right", "is_named"), [(2, 0, False), (3, 0, True), (40, 20, False), (40, 3, True)]
)
def test_folders_are_named_if_enough_turns_fit_another_order_and_few_the_given_one(
    swapped: int, right: int, is_named: bool
) -> None:
    assert bool(turning(np.arange(swapped + right) < swapped, np.zeros(swapped + right, bool))) == is_named


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: np.concatenate([t[:4], t[3:-1]]), "is not after that of the image before"),
        (lambda t: np.where(np.arange(COUNT) > 6, t + 9.0, t), "9.25 s without an image before 0007.png"),
        (lambda t: np.where(np.arange(COUNT) == 2, np.nan, t), "1 of 12 instants have no time"),
        (lambda t: 1e3 * t, "are 250 s apart"),
        (lambda t: 81.0 * t, "times.csv is in seconds"),
    ],
)
def test_times_that_cannot_be_are_named(sequence: images.ImageSet, change, said: str) -> None:
    problems = examination.examine(dataclasses.replace(sequence, time_s=change(sequence.time_s))).problems
    assert len(problems) == 1
    assert said in problems[0]


def test_images_twenty_seconds_apart_have_usual_times(sequence: images.ImageSet) -> None:
    assert examination.examine(dataclasses.replace(sequence, time_s=79.0 * sequence.time_s)).problems == ()


def test_cameras_without_a_common_instant_are_named(sequence: images.ImageSet) -> None:
    alternating = np.arange(len(sequence.instants))[:, None] % 2 == [[0, 1]]
    found = examination.examine(dataclasses.replace(sequence, present=alternating))
    assert "no two cameras have an image of the same name, which means the same instant" in found.problems
    alone = dataclasses.replace(sequence, rig=mapping.Rig(RIG.cameras[:1]), present=sequence.present[:, :1])
    assert examination.examine(alone).problems == ()


def test_few_instants_are_named(sequence: images.ImageSet) -> None:
    assert any("only 4 instants" in p for p in examination.examine(sequence.only(np.arange(4))).problems)
