"""Every example runs as its reader would run it, and prints something."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from firmware_bridge.betaflight_sitl import firmware
from tests.waiting import PATIENCE_S

EXAMPLES = sorted((Path(__file__).parent.parent / "examples").glob("[0-9][0-9]_*.py"))


def test_examples_are_numbered_without_gaps():
    assert [int(path.name[:2]) for path in EXAMPLES] == list(range(1, len(EXAMPLES) + 1))


LONG = ("04", "05", "09")
"""Half a minute each and more; what they show is held by tests/goshawk/demo/test_second_flight.py,
tests/sysid/diagnosis/test_diagnosis.py and by 09 itself, on Betaflight's firmware."""


@pytest.mark.parametrize(
    "script",
    [pytest.param(s, id=s.stem, marks=[pytest.mark.slow] if s.name.startswith(LONG) else []) for s in EXAMPLES],
)
def test_example_runs(script, tmp_path):
    if script.name.startswith("09"):
        try:
            firmware.program()
        except firmware.UnavailableError as reason:
            pytest.skip(str(reason))
    environment = os.environ | {"GOSHAWK_LINK_KEY": str(tmp_path / "link.key")}
    command = [sys.executable, str(script), str(tmp_path / "out")]
    patience_s = PATIENCE_S * (4.0 if script.name.startswith(LONG) else 1.0)
    answer = subprocess.run(
        command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=patience_s, check=False
    )
    assert answer.returncode == 0, answer.stderr
    assert answer.stdout.strip()
    assert script.read_text().startswith('"""')
    laps = re.findall(r"laps: (\d+) mm before, (\d+) mm after", answer.stdout)
    assert laps or not script.name.startswith("09"), answer.stdout
    drag = re.findall(r"drag_s_m: (\S+) learnt, (\S+) in the body", answer.stdout)
    assert drag or not script.name.startswith("09"), answer.stdout
    for learnt, true in drag:
        assert abs(float(learnt) / float(true) - 1.0) <= 0.1
    for before, after in laps:
        assert int(after) <= 0.5 * int(before)
