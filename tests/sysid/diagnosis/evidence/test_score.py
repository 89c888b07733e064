"""How sure a size by the score test is: its interval holds the true size as often as it says, of few blocks too."""

import numpy as np
import pytest

from sysid.diagnosis.evidence.evidence import Blocks
from sysid.diagnosis.evidence.score import score

GIVEN, TESTED = np.array([0]), np.array([1])
NORMAL_90 = 1.6449


def twins(rng: np.random.Generator, shown_by: int, blocks: int = 24, wild: float = 1.0) -> Blocks:
    """Without the tested effect, which `shown_by` blocks would show; errors white, or wilder than the fit has them."""
    own = np.zeros((blocks, 2, 2))
    own[:, 0, 0] = 1.0
    own[:shown_by, 1, 1], own[:shown_by, 0, 1], own[:shown_by, 1, 0] = 1.0, 0.3, 0.3
    pull = rng.standard_normal((blocks, 2)) * [1.0, np.sqrt(1.0 - 0.3**2)]
    pull[:, 1] += 0.3 * pull[:, 0]
    pull[shown_by:, 1] = 0.0
    return Blocks(wild * pull, own)


@pytest.mark.parametrize(("shown_by", "wild"), [(3, 1.0), (6, 1.0), (24, 1.0), (6, 3.0), (24, 3.0)])
def test_the_interval_of_a_size_holds_nothing_where_nothing_is_as_often_as_it_says(shown_by: int, wild: float):
    rng = np.random.default_rng(5)
    found = [score(twins(rng, shown_by, wild=wild), GIVEN, TESTED) for _ in range(400)]
    holds = np.mean([abs(one.size[0]) <= one.half90[0] for one in found])
    assert 0.86 < holds < 0.985


def test_a_normal_quantile_of_the_scatter_of_three_blocks_holds_too_little():
    rng = np.random.default_rng(5)
    found = [score(twins(rng, 3), GIVEN, TESTED) for _ in range(400)]
    assert np.mean([abs(one.size[0]) <= NORMAL_90 * one.sigma[0] for one in found]) < 0.86


def test_an_interval_is_never_narrower_than_white_noise_makes_it_and_knows_how_many_blocks_show_it():
    found = score(twins(np.random.default_rng(5), 6, wild=1e-3), GIVEN, TESTED)
    assert found.half90[0] == pytest.approx(NORMAL_90 * np.sqrt(found.plain[0]))
    assert 5.0 < found.shown_by[0] < 7.5
    assert score(twins(np.random.default_rng(5), 24), GIVEN, TESTED).shown_by[0] == pytest.approx(24.0)


def test_a_size_that_cannot_be_negative_and_comes_out_so_keeps_its_interval():
    blocks = twins(np.random.default_rng(5), 24)
    free = score(blocks, GIVEN, TESTED)
    sign = -np.sign(free.size[0])
    turned = Blocks(blocks.score * [1.0, sign], blocks.information * np.outer([1.0, sign], [1.0, sign]))
    held = score(turned, GIVEN, TESTED, np.array([True]))
    assert held.size[0] == 0.0
    assert held.half90[0] == pytest.approx(free.half90[0])
    assert len(held.first(1).half90) == 1
