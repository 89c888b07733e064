"""Blackbox logs from the format's description, by text of bits; shares no code with the reader."""

from collections.abc import Sequence

FIELDS = (
    # name, signed, predictor and encoding of I frames, of P frames
    ("loopIteration", 0, 0, 1, 6, 9),
    ("time", 0, 0, 1, 2, 0),
    *((f"axisI[{i}]", 1, 0, 0, 1, 7) for i in range(3)),
    *((f"setpoint[{i}]", 1, 0, 0, 1, 8) for i in range(4)),
    ("vbatLatest", 0, 9, 3, 1, 6),
    ("amperageLatest", 1, 0, 0, 1, 6),
    ("rssi", 0, 0, 1, 1, 6),
    *((f"gyroADC[{i}]", 1, 0, 0, 3, 0) for i in range(3)),
    *((f"accSmooth[{i}]", 1, 0, 0, 3, 0) for i in range(3)),
    *((f"imuQuaternion[{i}]", 1, 0, 0, 3, 0) for i in range(3)),
    ("motor[0]", 0, 11, 1, 3, 0),
    *((f"motor[{i}]", 0, 5, 0, 3, 0) for i in range(1, 4)),
    *((f"eRPM[{i}]", 0, 0, 1, 1, 0) for i in range(4)),
    *((f"debug[{i}]", 1, 0, 0, 1, 10) for i in range(3)),
)
NAMES = [field[0] for field in FIELDS]
Fields = Sequence[tuple[str, int, int, int, int, int]]
HEADER = {
    "Product": "Blackbox flight data recorder by Nicholas Sherlock",
    "Data version": "2",
    "Field S name": "flightModeFlags,stateFlags,failsafePhase,rxSignalReceived,rxFlightChannelsValid",
    "Field S signed": "0,0,0,0,0",
    "Field S predictor": "0,0,0,0,0",
    "Field S encoding": "1,1,7,7,7",
    "Firmware revision": "Betaflight 4.5.1 (77d01ba3b) STM32F7X2",
    "gyro_scale": "0x3f800000",
    "acc_1G": "2048",
    "motorOutput": "158,2047",
    "motor_poles": "14",
    "vbatref": "1600",
    "minthrottle": "1070",
}


def without(*groups: str) -> Fields:
    """The fields of a recorder that leaves these out."""
    return [field for field in FIELDS if not field[0].startswith(groups)]


def header(fields: Fields = FIELDS, **other: str) -> bytes:
    names = ("I name", "I signed", "I predictor", "I encoding", "P predictor", "P encoding")
    said = {f"Field {name}": ",".join(str(field[i]) for field in fields) for i, name in enumerate(names)}
    return b"".join(f"H {name}:{value}\n".encode() for name, value in {**HEADER, **said, **other}.items())


def frames(rows: Sequence[Sequence[int]], *, fields: Fields = FIELDS, whole_every: int = 32) -> bytes:
    """Rows of values in the order of the fields, then the end of the log."""
    out = [b"S" + _unsigned(3) + _unsigned(0) + _bits("00 00 01 00") + b"E\x00" + _unsigned(12345)]
    last: Sequence[int] = []
    before: Sequence[int] = []
    for k, row in enumerate(rows):
        whole = k % whole_every == 0
        before = row if whole else before
        out.append((b"I" if whole else b"P") + _frame(fields, row, last, before, whole))
        before, last = (row, row) if whole else (last, row)
    return b"".join([*out, b"E\xffEnd of log\x00"])


def _frame(fields: Fields, row: Sequence[int], last: Sequence[int], before: Sequence[int], whole: bool) -> bytes:
    out, waiting, first_motor = b"", [], [field[0] for field in fields].index("motor[0]")
    for i, (_, _, i_predictor, i_encoding, p_predictor, p_encoding) in enumerate(fields):
        predictor, encoding = (i_predictor, i_encoding) if whole else (p_predictor, p_encoding)
        predicted = {0: 0, 5: row[first_motor], 6: row[i], 9: 1600, 11: 158}.get(predictor)
        if predicted is None:
            both = (last[i] + before[i]) / 2
            predicted = {1: last[i], 2: 2 * last[i] - before[i], 3: int(both)}[predictor]
        waiting.append(row[i] - predicted)
        following = fields[i + 1][3 if whole else 5] if i + 1 < len(fields) else -1
        most = {6: 8, 7: 3, 8: 4, 10: 3}.get(encoding, 1)
        if following != encoding or len(waiting) == most:
            out += _packed(encoding, waiting)
            waiting = []
    return out


def _packed(encoding: int, values: list[int]) -> bytes:
    if encoding == 9:
        return b""
    if encoding == 1:
        return _unsigned(values[0])
    if encoding == 0:
        return _signed(values[0])
    if encoding == 3:
        return _unsigned(-values[0] & 0x3FFF)
    return {6: _eight, 7: _three, 8: _four, 10: _three_unlike}[encoding](values)


def _unsigned(value: int) -> bytes:
    value %= 2**32
    groups = [value >> shift & 127 for shift in range(0, 35, 7)]
    while len(groups) > 1 and groups[-1] == 0:
        groups.pop()
    return bytes([*(g + 128 for g in groups[:-1]), groups[-1]])


def _signed(value: int) -> bytes:
    return _unsigned(2 * value if value >= 0 else -2 * value - 1)


def _bits(text: str) -> bytes:
    text = text.replace(" ", "")
    return bytes(int(text[i : i + 8], 2) for i in range(0, len(text), 8))


def _word(value: int, bits: int) -> str:
    return format(value % 2**bits, f"0{bits}b")


def _fits(values: Sequence[int], bits: Sequence[int]) -> bool:
    return all(-(2 ** (b - 1)) <= v < 2 ** (b - 1) for v, b in zip(values, bits, strict=True))


def _eight(values: list[int]) -> bytes:
    if len(values) == 1:
        return _signed(values[0])
    tag = sum(1 << i for i, v in enumerate(values) if v)
    return bytes([tag]) + b"".join(_signed(v) for v in values if v)


def _sized(values: list[int]) -> bytes:
    sizes = [next(n for n in (1, 2, 3, 4) if _fits([v], [8 * n])) for v in values]
    tag = "11" + "".join(_word(n - 1, 2) for n in reversed(sizes))
    return _bits(tag) + b"".join(v.to_bytes(n, "little", signed=True) for v, n in zip(values, sizes, strict=True))


def _three(values: list[int]) -> bytes:
    a, b, c = values
    if _fits(values, (2, 2, 2)):
        return _bits(f"00{_word(a, 2)}{_word(b, 2)}{_word(c, 2)}")
    if _fits(values, (4, 4, 4)):
        return _bits(f"0100{_word(a, 4)}{_word(b, 4)}{_word(c, 4)}")
    if _fits(values, (6, 6, 6)):
        return _bits(f"10{_word(a, 6)}00{_word(b, 6)}00{_word(c, 6)}")
    return _sized(values)


def _three_unlike(values: list[int]) -> bytes:
    a, b, c = values
    if _fits(values, (2, 2, 2)):
        return _bits(f"00{_word(a, 2)}{_word(b, 2)}{_word(c, 2)}")
    if _fits(values, (5, 5, 4)):
        return _bits(f"01{_word(a, 5)}{_word(b, 5)}{_word(c, 4)}")
    if _fits(values, (8, 7, 7)):
        return _bits(f"10{_word(a, 8)}{_word(b, 7)}{_word(c, 7)}")
    return _sized(values)


def _four(values: list[int]) -> bytes:
    sizes = [0 if v == 0 else next(n for n in (4, 8, 16) if _fits([v], [n])) for v in values]
    tag = "".join(_word({0: 0, 4: 1, 8: 2, 16: 3}[n], 2) for n in reversed(sizes))
    body = "".join(_word(v, n) for v, n in zip(values, sizes, strict=True) if n)
    return _bits(tag + body + "0" * (-len(body) % 8))
