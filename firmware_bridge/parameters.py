"""The controller's parameters over the link: read by name, written as one block or not at all."""

import difflib
import math
import queue
import secrets
import struct
import time
import zlib
from collections.abc import Iterable, Mapping

import numpy as np

from firmware_bridge import controller
from firmware_bridge.dialect.generated.messages import (
    MissionStatus,
    ParametersCommit,
    ParametersResult,
    ParametersStage,
    ParamRequestList,
    ParamRequestRead,
    ParamValue,
)
from firmware_bridge.port import Port
from firmware_bridge.words import reason_text
from flight import InputError, LinkError

_GROUP = 48
_ABOUT_ONE = (1, 2)
"""TC_NOT_FINITE, TC_OUT_OF_RANGE: reasons that are about a single value."""


def table(port: Port) -> list[tuple[str, float]]:
    """Names and values in the vehicle's order.

    Raises:
        LinkError: the vehicle stopped answering.
    """
    found: dict[int, ParamValue] = {}
    count = 1
    heard_s = time.monotonic()
    with port.inbox(ParamValue) as inbox:
        port.send(ParamRequestList())
        while len(found) < count:
            if time.monotonic() - heard_s > port.timeout_s:
                raise port.silence()
            try:
                value = inbox.get(timeout=0.1)
            except queue.Empty:
                for index in [i for i in range(count) if i not in found][:16] if found else []:
                    port.send(ParamRequestRead(param_index=index))
                if not found:
                    port.send(ParamRequestList())
                continue
            if isinstance(value, ParamValue) and value.param_index < value.param_count:
                found[value.param_index] = value
                count = value.param_count
                heard_s = time.monotonic()
    return [(found[i].param_id, found[i].param_value) for i in range(count)]


def read(port: Port) -> dict[str, float]:
    """All parameters by name."""
    return dict(table(port))


def write(port: Port, values: dict[str, float]) -> None:
    """Change some parameters, all of them or none; then check the CRC of what is in force.

    Raises:
        InputError: an unknown name, or a value that is not finite.
        LinkError: refused, or silence.
    """
    present = table(port)
    names = [name for name, _ in present]
    refuse_unknown(values, names)
    for name, value in values.items():
        if not math.isfinite(value):
            raise InputError(f"{name} = {value} is not finite")
    block = [values.get(name, value) for name, value in present]
    packed = struct.pack(f"<{len(block)}f", *block)
    transfer_id = secrets.randbits(32) or 1
    for group in range(-(-len(block) // _GROUP)):
        part = block[_GROUP * group : _GROUP * (group + 1)]
        stage = ParametersStage(transfer_id=transfer_id, group=group, values=(*part, *[0.0] * (_GROUP - len(part))))

        def about_it(result: ParametersResult, bit: int = 1 << group) -> bool:
            return result.transfer_id == transfer_id and bool(result.staged & bit or result.reason)

        _accepted(port.ask(stage, ParametersResult, about_it), names)
    commit = ParametersCommit(transfer_id=transfer_id, crc32=zlib.crc32(packed))
    answer = port.ask(commit, ParametersResult, lambda r: r.transfer_id == transfer_id and bool(r.committed))
    _accepted(answer, names)
    if answer.active_crc32 != zlib.crc32(packed):
        raise LinkError("the vehicle applied the parameters, but holds others now; read them again")
    port.latest.pop(MissionStatus, None)  # it carries the CRC of the old ones


def difference(present: Mapping[str, float], wanted: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Values present and wanted, of the parameters that differ as float32, in the vehicle's order."""
    before, after = shortest(present), shortest(wanted)
    return {name: (before[name], after[name]) for name in before if name in after and before[name] != after[name]}


def shortest(values: Mapping[str, float]) -> dict[str, float]:
    """The same float32 values with the fewest digits that identify them: 0.7, not 0.699999988."""
    return {name: float(str(np.float32(value))) for name, value in values.items()}


def refuse_unknown(names: Iterable[str], known: Iterable[str]) -> None:
    """
    Raises:
        InputError: a name is not among the vehicle's; the message has the nearest.
    """
    known = list(known)
    for name in names:
        if name not in known:
            near = difflib.get_close_matches(name, known, 3, 0.4)
            hint = f"; did you mean {' or '.join(near)}?" if near else "; `goshawk params list` shows all"
            raise InputError(f"the vehicle has no parameter {name}{hint}")


def _accepted(answer: ParametersResult, names: list[str]) -> None:
    if answer.reason:
        raise LinkError(
            f"the vehicle refused the parameters: {reason_text(answer.reason)}{_where(answer, names)}; "
            "nothing was changed"
        )


def _where(answer: ParametersResult, names: list[str]) -> str:
    """Which parameter a refusal is about, and what it may be."""
    if answer.reason not in _ABOUT_ONE or answer.index >= len(names):
        return ""
    row = controller.PARAMETERS.get(names[answer.index])
    span = f" may be {row.smallest:g} to {row.largest:g}" if row else ""
    return f" ({names[answer.index]}{span})"
