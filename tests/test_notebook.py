"""The notebook runs from the top in a fresh namespace, as Jupyter would run it, and shows what it says."""

import ast
import json
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure

NOTEBOOK = Path(__file__).parent.parent / "examples" / "plan_check_plot_identify.ipynb"
CELLS = json.loads(NOTEBOOK.read_text())["cells"]


def run(cell: dict[str, Any], names: dict[str, Any]) -> object:
    """Run a code cell and give the value of its last line, if it has one; Jupyter's own commands are skipped."""
    lines = [line for line in cell["source"] if not line.startswith("%")]
    *first, last = ast.parse("".join(lines)).body
    if not isinstance(last, ast.Expr):
        first, last = [*first, last], None
    exec(compile(ast.Module(first, []), NOTEBOOK.name, "exec"), names)
    return None if last is None else eval(compile(ast.Expression(last.value), NOTEBOOK.name, "eval"), names)


def test_every_cell_runs_and_the_fit_finds_what_the_model_lacked(capsys):
    names: dict[str, Any] = {"__name__": "__main__"}
    shown = [run(cell, names) for cell in CELLS if cell["cell_type"] == "code"]
    assert sum(isinstance(each, Figure) for each in shown) == 4
    printed = capsys.readouterr().out
    assert "passed  clearance" in printed
    assert "FAILED" not in printed
    for name in (names["thrust"], "rotor_drag_thrust.drag_s_m"):
        found, true = names["fit"].estimate(name), names["truth"].value(name)
        assert abs(found.value - true) < 4.0 * found.std_robust
        assert name in printed
    before, after = (names["compared"].wrench_rms(model)[:3] for model in ("before", "after"))
    assert after.max() < 0.3 * before.max()


def test_the_notebook_is_kept_without_results():
    """What a cell shows is made by who runs it: results in the file would grow stale, and hide a change in a diff."""
    code = [cell for cell in CELLS if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)
    assert len(CELLS) <= 16


def test_a_cell_that_fails_is_noticed():
    with pytest.raises(ZeroDivisionError):
        run({"source": ["%matplotlib inline\n", "1 / 0"]}, {})
    assert run({"source": ["x = 2\n", "x + 1"]}, {}) == 3
