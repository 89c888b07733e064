"""Standard deviations in tables of recorded poses: above 0, or not known."""

from collections.abc import Sequence
from pathlib import Path

import pytest

from flight import FormatError
from mapping.input import trajectory

HEADER = "image,time_s,x_m,y_m,z_m,qw,qx,qy,qz,x_std_m,y_std_m,z_std_m,turn_std_rad"


def write(path: Path, stds: Sequence[str]) -> Path:
    rows = [f"a{k}.png,{0.1 * k:.1f},{0.1 * k:.1f},0,0,1,0,0,0,{std}" for k, std in enumerate(stds)]
    path.write_text("\n".join([HEADER, *rows, ""]))
    return path


@pytest.mark.parametrize("wrong", ["0,0.02,0.02,0.01", "0.02,0.02,-1,0.01", "0.02,0.02,0.02,0"])
def test_a_standard_deviation_that_is_not_above_0_is_refused_with_its_line(tmp_path: Path, wrong: str) -> None:
    path = write(tmp_path / "poses.csv", ["0.02,0.02,0.02,0.01"] * 3 + [wrong])
    with pytest.raises(FormatError, match=r"line 5: [xz_stdmurna]+ is (0|-1), but a standard deviation is above 0"):
        trajectory.read(path)


@pytest.mark.parametrize("unknown", ["nan,nan,nan,nan", ",,,", "0.02,0.02,0.02,"])
def test_poses_of_unknown_standard_deviation_are_read_and_do_not_count_in_it(tmp_path: Path, unknown: str) -> None:
    known = trajectory.read(write(tmp_path / "poses.csv", [unknown] * 3 + ["0.02,0.02,0.02,0.01"] * 2))
    assert len(known.time_s) == 5
    assert known.std == pytest.approx((0.01, 0.02))
    assert trajectory.read(write(tmp_path / "poses.csv", [unknown] * 5)).std is None
