"""What `make test-quick` runs."""

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from tests.quick import BUDGET_S, elsewhere_s, within

ROOT = Path(__file__).parent.parent

TIMES = st.dictionaries(st.text(min_size=1, max_size=5), st.floats(0.0, 100.0), min_size=1)


@given(TIMES, st.floats(1.0, 300.0))
def test_the_files_that_take_least_are_run_as_many_as_fit(took_s, budget_s):
    chosen = within(budget_s, took_s)
    left = took_s.keys() - chosen
    assert sum(took_s[file] for file in chosen) <= budget_s + 1e-6 or len(chosen) == 1
    assert all(took_s[a] <= took_s[b] for a in chosen for b in left)
    if left:
        next_s = min(took_s[file] for file in left)
        assert sum(took_s[file] for file in chosen) + next_s > budget_s - 1e-6


def test_the_committed_seconds_are_of_files_that_there_are_and_let_each_package_run_more_than_one():
    took_s = elsewhere_s()
    assert not [file for file in took_s if not (ROOT / file).is_file()]
    for package in (ROOT / "tests").iterdir():
        files = [str(file.relative_to(ROOT)) for file in package.rglob("test_*.py")] or ["none"]
        assert len(within(BUDGET_S, {file: took_s.get(file, 0.0) for file in files})) > len(files) // 4
