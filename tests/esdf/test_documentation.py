"""The page about the distance field shows code that runs."""

import re
from pathlib import Path

import numpy as np

from flight import Trajectory

PAGE = Path(__file__).parents[2] / "docs" / "explain" / "distance_field.md"


def test_the_first_example_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    code = re.search(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert code is not None
    coefficients = np.zeros((1, 4, 2))
    coefficients[0, :3] = [[1.0, 1.0], [1.0, 0.0], [1.2, 0.0]]
    exec(code[1], {"trajectory": Trajectory(np.array([3.0]), coefficients)})
    assert capsys.readouterr().out.startswith("True")
