"""A text as a QR code, that a phone's camera reads: ISO/IEC 18004, bytes, error correction M, versions 1 to 6."""

import numpy as np
from numpy.typing import NDArray

from flight import InputError

QUIET = 4
"""Modules of white that a reader needs round it."""
_BLOCKS = {1: (1, 16, 10), 2: (1, 28, 16), 3: (1, 44, 26), 4: (2, 32, 18), 5: (2, 43, 24), 6: (4, 27, 16)}
"""By version, at level M: blocks, and of each its data and its check bytes (table 9)."""
_BYTES, _MASK = 0b0100, 0
"""Mode, and the mask (row + column even): which one is best matters to figures with large plain areas only."""
_FIELD, _FORMAT, _FORMAT_MASK = 0x11D, 0x537, 0x5412
"""Polynomials of the Galois field of 256 and of the format's check bits, and what these are combined with."""

Modules = NDArray[np.bool_]


def matrix(text: str) -> Modules:
    """(n, n), true: dark; without the white round it.

    Raises:
        InputError: the text has more than 106 bytes.
    """
    data = text.encode()
    version = next((v for v, (blocks, size, _) in _BLOCKS.items() if len(data) + 2 <= blocks * size), None)
    if version is None:
        raise InputError(f"{len(data)} bytes are too many for a QR code of at most 106; give a shorter --host")
    dark, taken = _figures(version)
    row, column = np.array(list(_way(taken))).T
    bits = np.zeros(len(row), dtype=bool)
    stream = np.unpackbits(_interleaved(_padded(data, version), version))
    bits[: len(stream)] = stream
    dark[row, column] = bits ^ ((row + column) % 2 == 0)
    return dark


def _padded(data: bytes, version: int) -> NDArray[np.uint8]:
    """Mode, length, data and an end, filled up."""
    blocks, size, _ = _BLOCKS[version]
    number = int.from_bytes(bytes([_BYTES, len(data), *data]), "big") << 4  # a mode has four bits, as the end has
    head = number.to_bytes(len(data) + 3, "big")[1:]
    fill = [0xEC, 0x11] * (blocks * size)
    return np.array([*head, *fill][: blocks * size], dtype=np.uint8)


def _interleaved(words: NDArray[np.uint8], version: int) -> NDArray[np.uint8]:
    """First bytes of all blocks, then second ones ...; then the check bytes likewise."""
    blocks, size, checks = _BLOCKS[version]
    data = words.reshape(blocks, size)
    check = np.array([_check_bytes(block.tolist(), checks) for block in data], dtype=np.uint8)
    return np.concatenate([data.T.ravel(), check.T.ravel()])


def _check_bytes(data: list[int], count: int) -> list[int]:
    """Reed-Solomon: what is left of the data, times x^count, by the generator's polynomial."""
    generator = [1]
    for power in range(count):
        root = _power(power)
        product = [*generator, 0]
        for k, factor in enumerate(generator):
            product[k + 1] ^= _times(factor, root)
        generator = product
    rest = [*data, *[0] * count]
    for k in range(len(data)):
        for j, factor in enumerate(generator):
            rest[k + j] ^= _times(factor, rest[k]) if j else 0
    return rest[len(data) :]


def _power(exponent: int) -> int:
    value = 1
    for _ in range(exponent):
        value = _times(value, 2)
    return value


def _times(a: int, b: int) -> int:
    product = 0
    while b:
        product ^= a if b & 1 else 0
        a = (a << 1) ^ (_FIELD if a & 0x80 else 0)
        b >>= 1
    return product


def _figures(version: int) -> tuple[Modules, Modules]:
    """What every code of a version has: its dark modules, and where no data is."""
    n = 17 + 4 * version
    dark, taken = np.zeros((n, n), dtype=bool), np.zeros((n, n), dtype=bool)
    taken[6], taken[:, 6] = True, True
    dark[6], dark[:, 6] = np.arange(n) % 2 == 0, np.arange(n) % 2 == 0
    for top, left in ((0, 0), (0, n - 7), (n - 7, 0)):
        rows, columns = (slice(max(at - 1, 0), at + 8) for at in (top, left))
        dark[rows, columns], taken[rows, columns] = False, True
        dark[top : top + 7, left : left + 7] = _rings(3)
    taken[:9, :9] = taken[:9, n - 8 :] = taken[n - 8 :, :9] = True
    if version > 1:
        at = slice(n - 9, n - 4)
        dark[at, at], taken[at, at] = _rings(2), True
    _write_format(dark)
    return dark, taken


def _rings(reach: int) -> Modules:
    """A finder (3) or an alignment mark (2): rings about a middle, with one white ring."""
    away = np.abs(np.arange(-reach, reach + 1))
    ring = np.maximum(away[:, None], away)
    return ring != reach - 1


def _write_format(dark: Modules) -> None:
    """Level and mask with their check bits, twice, and the one module that is always dark."""
    n, level_m = len(dark), 0b00
    rest = (level_m << 3 | _MASK) << 10
    for shift in range(4, -1, -1):
        rest ^= _FORMAT << shift if rest >> (shift + 10) & 1 else 0
    word = ((level_m << 3 | _MASK) << 10 | rest) ^ _FORMAT_MASK
    bits = [bool(word >> k & 1) for k in range(15)]  # the lowest first
    dark[[*range(6), 7, 8], 8] = bits[:8]
    dark[8, [7, *range(5, -1, -1)]] = bits[8:]
    dark[8, n - 1 : n - 9 : -1] = bits[:8]
    dark[n - 7 :, 8] = bits[8:]
    dark[n - 8, 8] = True


def _way(taken: Modules) -> list[tuple[int, int]]:
    """Free modules in the order of the bits: two columns at a time from the right, up and down in turn."""
    n = len(taken)
    places, up = [], True
    for right in [*range(n - 1, 6, -2), 5, 3, 1]:
        for row in range(n - 1, -1, -1) if up else range(n):
            places += [(row, column) for column in (right, right - 1) if not taken[row, column]]
        up = not up
    return places
