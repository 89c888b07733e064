"""QR codes of the station's address, read again by OpenCV."""

import numpy as np
import pytest

from flight import InputError
from gcs_web.gateway import qr

cv2 = pytest.importorskip("cv2")


def read(code: np.ndarray) -> str:
    picture = np.kron(np.pad(~code, qr.QUIET, constant_values=True), np.ones((6, 6), dtype=bool))
    return cv2.QRCodeDetector().detectAndDecode(255 * picture.astype(np.uint8))[0]


@pytest.mark.parametrize("length", [1, 14, 15, 26, 27, 42, 43, 62, 63, 84, 85, 106])
def test_a_code_of_any_version_is_read_as_it_was_written(length):
    rng = np.random.default_rng(length)
    text = "".join(rng.choice(list("abcdefghijkXYZ0123456789-_/:.?="), length))
    code = qr.matrix(text)
    assert len(code) in {17 + 4 * version for version in range(1, 7)}
    assert read(code) == text


def test_a_code_is_read_with_some_modules_spoilt():
    text = "https://station.example:8080/?token=6-UlGgJ7lyL0vC2yHf0kqTnQ9bUm3xWz"
    code = qr.matrix(text)
    rng = np.random.default_rng(3)
    rows, columns = rng.integers(9, len(code) - 9, (2, 8))
    code[rows, columns] ^= True
    assert read(code) == text


def test_a_text_that_is_too_long_is_refused():
    with pytest.raises(InputError, match="107 bytes are too many"):
        qr.matrix("x" * 107)
