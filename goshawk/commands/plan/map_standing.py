"""What planning asks of a map's verdict: a refused map is not planned in, a doubtful one only when the user agrees."""

import sys

import click

from flight import InputError
from goshawk.terminal import console
from mapping import Map
from mapping.verdict import Standing

accept_option = click.option(
    "--accept-doubtful-map", "accept_doubtful", is_flag=True, help="Plan although the map's verdict is doubtful."
)


def require(area: Map, *, accept_doubtful: bool) -> None:
    """Check, before planning, that the map may be planned in; asks on a terminal.

    Raises:
        InputError: it is refused, or doubtful and the user did not agree.
    """
    area.require_not_refused()
    reasons = "; ".join(area.reasons)
    if area.standing is Standing.NOT_JUDGED:
        of_old = "it is of a version that did not try its calibration; make it again"
        console.note(f"note: {area.folder}: {reasons or of_old}")
    if area.standing is not Standing.DOUBTFUL or accept_doubtful:
        return
    if sys.stdin.isatty() and click.confirm(f"{area.folder} is doubtful: {reasons}. Plan in it?", err=True):
        return
    raise InputError(f"{area.folder} is doubtful: {reasons}; make it again, or give --accept-doubtful-map")
