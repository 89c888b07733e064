"""Words for the reason codes of the controller and of the link."""

from firmware_bridge import _controller
from firmware_bridge.dialect.generated.messages import LinkReason

_OF_THE_LINK = {
    LinkReason.NOT_IN_CONTROL: "another station, or nobody, is in control of it",
    LinkReason.UNSUPPORTED: "it knows no such command",
    LinkReason.OTHER_TRAJECTORY: "it holds another trajectory",
    LinkReason.NO_LOG_MEMORY: "it has no memory for a log",
    LinkReason.SAMPLES_MISSING: "the check samples have not arrived",
}


def reason_text(code: int) -> str:
    """A reason of `tc_reason` or of the link, in words."""
    return _OF_THE_LINK.get(LinkReason(code), "") if code in _OF_THE_LINK else _controller.reason_text(code)
