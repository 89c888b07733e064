"""Pytest plugin of `make test-quick`: of the chosen tests' files those that took least before, a minute of them.

Every run of whole files writes down what each took, set-ups included. For one that never ran here, `seconds.toml` says
what it took elsewhere; for one that is not there either, nothing. Whatever the files take, none of their tests begins
after `LAST_START_S`.
"""

import os
import time
import tomllib
from collections import defaultdict
from pathlib import Path

import pytest

KEY = "goshawk/seconds_of_files"
TABLE = Path(__file__).with_name("seconds.toml")
BUDGET_S = 90.0
"""Of work, on two processors about three quarters of a minute."""
LAST_START_S = 45.0
"""After the start of pytest. Tests that would begin later are skipped, and counted as such."""
STARTED = "GOSHAWK_TESTS_STARTED_S"
"""Where workers read the first process' start, on the clock that all processes share."""
_took_s: dict[str, float] = defaultdict(float)


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--quick", action="store_true", help="only the files that took least, a minute of them")


def pytest_configure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        os.environ[STARTED] = str(time.monotonic())


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    if item.config.getoption("--quick") and time.monotonic() - float(os.environ[STARTED]) > LAST_START_S:
        pytest.skip("the minute is over")


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    _took_s[report.nodeid.split("::")[0]] += report.duration


def pytest_sessionfinish(session: pytest.Session) -> None:
    config, cache = session.config, _cache(session.config)
    whole = not (config.getoption("keyword") or session.shouldstop or any("::" in place for place in config.args))
    reports = not hasattr(config, "workerinput")  # workers report to the first process
    if cache is not None and whole and reports:
        cache.set(KEY, {**cache.get(KEY, {}), **{file: round(took_s, 3) for file, took_s in _took_s.items()}})


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.getoption("--quick"):
        return
    files = {item.nodeid.split("::")[0] for item in items}
    chosen = within(BUDGET_S, {file: _known_s(config).get(file, 0.0) for file in files})
    left_out = [item for item in items if item.nodeid.split("::")[0] not in chosen]
    config.hook.pytest_deselected(items=left_out)
    items[:] = [item for item in items if item.nodeid.split("::")[0] in chosen]


def within(budget_s: float, took_s: dict[str, float]) -> set[str]:
    """The files that take least, as many as the budget allows, and at least one."""
    chosen: set[str] = set()
    for file, cost_s in sorted(took_s.items(), key=lambda pair: (pair[1], pair[0])):
        budget_s -= cost_s
        if budget_s < 0.0 and chosen:
            break
        chosen.add(file)
    return chosen


def elsewhere_s() -> dict[str, float]:
    """What files took where `seconds.toml` was written."""
    return {f"tests/{file}": took_s for file, took_s in tomllib.loads(TABLE.read_text()).items()}


def _known_s(config: pytest.Config) -> dict[str, float]:
    cache = _cache(config)
    return elsewhere_s() | ({} if cache is None else cache.get(KEY, {}))


def _cache(config: pytest.Config) -> pytest.Cache | None:
    """None under `-p no:cacheprovider`."""
    return getattr(config, "cache", None)
