"""What the vehicle does by itself when the link is lost, and when: `observe_link` of the controller, in words."""

from collections.abc import Mapping

from firmware_bridge.wire import LinkLoss
from gcs_web.protocol.vehicle import LostLinkAct

_HOVERING = ("hold", "paused")
_ON_PATH = ("trajectory", "pausing", "stopping")


def acts(mission: str, policy: LinkLoss | None, parameters: Mapping[str, float]) -> list[LostLinkAct]:
    """In their order, each with the silence after which it begins; none where that is not known.

    Args:
        mission: state of the vehicle when it was last heard.
        policy: of the trajectory that is flown; None: not known.
        parameters: of the controller, s.
    """
    lost_s, hold_s = parameters.get("link_loss_s"), parameters.get("link_hold_s")
    if lost_s is None or hold_s is None:
        return []
    if mission in _HOVERING:
        return [LostLinkAct(max(lost_s, hold_s), "lands")]
    if mission not in _ON_PATH or policy is None:
        return []
    if policy is LinkLoss.LAND:
        return [LostLinkAct(lost_s, "brakes and lands")]
    first = "stops and hovers" if policy is LinkLoss.HOLD else "flies to the end of the path and hovers"
    return [LostLinkAct(lost_s, first), LostLinkAct(lost_s + hold_s, "lands")]
