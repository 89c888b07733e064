"""What `make test-quick` runs."""

from hypothesis import given
from hypothesis import strategies as st

from tests.quick import within

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
