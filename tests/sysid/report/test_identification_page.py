"""What the head of an identification's page says of what was not estimated."""

from types import SimpleNamespace
from typing import Any, cast

import pytest

from sysid.estimator.result import NOT_IDENTIFIABLE, NOT_SETTLED, Estimate
from sysid.report.pages import _known


@pytest.mark.parametrize(
    ("status", "sentence"),
    [
        (NOT_IDENTIFIABLE, "Held, because they are not identifiable from these flights: drag."),
        (NOT_SETTLED, "Held, because the fit did not settle with them free: drag."),
        ("held", None),
    ],
)
def test_the_page_lists_what_is_held_for_want_of_information(status, sentence):
    inertia = Estimate("inertia", 2.0, "kg m2", 0.1, 0.1, 1.0, "free", (1.0,), 0.2)
    drag = Estimate("drag", 2.0, "kg", 0.0, 0.0, 2.0, status, (), 0.0)
    said = _known(cast("Any", SimpleNamespace(parameters=(inertia, drag), flights=())))
    assert "5% (inertia)" in said
    assert said.count("Held") == (sentence is not None)
    assert sentence is None or sentence in said
