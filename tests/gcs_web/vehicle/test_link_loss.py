"""What the page says the vehicle does without a link is what the controller does."""

import pytest

from firmware_bridge.wire import LinkLoss
from gcs_web.vehicle import link_loss

PARAMETERS = {"link_loss_s": 2.0, "link_hold_s": 20.0}


@pytest.mark.parametrize("policy", LinkLoss)
def test_whatever_the_policy_the_vehicle_lands_in_the_end(policy: LinkLoss):
    acts = link_loss.acts("trajectory", policy, PARAMETERS)
    assert "lands" in acts[-1].act
    assert [each.after_s for each in acts] == sorted(each.after_s for each in acts)


def test_a_longer_patience_never_brings_an_act_earlier():
    for name in PARAMETERS:
        longer = {**PARAMETERS, name: 2.0 * PARAMETERS[name]}
        for mission in ("trajectory", "hold"):
            before, after = (link_loss.acts(mission, LinkLoss.HOLD, p) for p in (PARAMETERS, longer))
            assert all(b.after_s <= a.after_s for b, a in zip(before, after, strict=True))


def test_nothing_is_said_of_what_is_not_known():
    assert link_loss.acts("trajectory", None, PARAMETERS) == []
    assert link_loss.acts("trajectory", LinkLoss.HOLD, {}) == []
    assert link_loss.acts("disarmed", LinkLoss.HOLD, PARAMETERS) == []
