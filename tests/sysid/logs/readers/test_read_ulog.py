"""ULog files of PX4: what is read where the newest topics were not logged."""

import numpy as np
import pytest

from sysid.logs.reading import read_log
from tests.sysid.logs import px4_file

RATIOS = [f"motor_command_{i}_ratio" for i in range(4)]


def _read(log, outputs, folder, parameters=None):
    (folder / "f.ulg").write_bytes(px4_file.ulog(log, outputs=outputs, parameters=parameters))
    return read_log(folder / "f.ulg")


def test_pulses_of_the_outputs_are_commands(log, tmp_path):
    ratio = (log.vector("rotor_speed_rad_s") / 2000.0).clip(0.0, 1.0)
    read = _read(log, 1000.0 + 1000.0 * ratio, tmp_path)
    told = np.stack([read.columns[name] for name in RATIOS], axis=1)
    rows = slice(2, len(log) - 2)
    assert told[rows] == pytest.approx(ratio[rows], abs=2e-4)
    stopped = _read(log, np.zeros_like(ratio), tmp_path)
    assert not set(RATIOS) & set(stopped.columns)


@pytest.mark.parametrize(("lowest", "highest"), [(48.0, 2047.0), (0.0, 8191.0), (1000.0, 2400.0)])
def test_outputs_in_another_unit_are_no_commands(log, tmp_path, lowest, highest):
    ratio = np.linspace(0.0, 1.0, len(log))[:, None] * np.ones(4)
    assert not set(RATIOS) & set(_read(log, lowest + (highest - lowest) * ratio, tmp_path).columns)


@pytest.mark.parametrize(
    ("parameters", "rotors"),
    [
        ({}, 4),
        ({"MAV_TYPE": 2}, 4),
        ({"MAV_TYPE": 13}, 6),
        ({"MAV_TYPE": 14}, 8),
        ({"CA_ROTOR_COUNT": 6, "MAV_TYPE": 2}, 6),
        ({"CA_ROTOR_COUNT": 0, "MAV_TYPE": 0}, 4),
    ],
)
def test_parameters_say_how_many_outputs_are_motors_and_servos_are_none(log, tmp_path, parameters, rotors):
    outputs = np.full((len(log), 8), 1500.0)
    read = _read(log, outputs, tmp_path, parameters)
    assert [f"motor_command_{i}_ratio" in read.columns for i in range(8)] == [i < rotors for i in range(8)]
