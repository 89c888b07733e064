"""The browsers that came in: known again by the hash of their cookie, also by a station that was started anew."""

import contextlib
import hashlib
import hmac
import json
import logging
import os
import secrets
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

logger = logging.getLogger(__name__)

MOST = 64
"""Cookies that are good at a time; the oldest is forgotten first."""
LIFE_S = 12 * 3600.0
"""A cookie is good for a day in the field."""


class Entrants:
    """Cookies are kept as SHA-256 only, in a file that only its owner can read: whoever copies it cannot come in."""

    def __init__(self, file: Path | None = None, known: Sequence[tuple[str, float]] = ()) -> None:
        """
        Args:
            file: where they are kept; None: nowhere.
            known: hashes and times of entry (s since 1970) of a station that had this port before.
        """
        self._file = file
        self.known = [*known, *(entry for entry in self._read() if entry not in known)]

    def admit(self) -> str:
        """A cookie for a browser that showed the token."""
        cookie = secrets.token_urlsafe(24)
        self.known = [*self._good(), (_hash(cookie), time.time())][-MOST:]
        self._write()
        return cookie

    def knows(self, cookie: str) -> bool:
        given = _hash(cookie)
        return any(hmac.compare_digest(given, known) for known, _ in self._good())

    def _good(self) -> list[tuple[str, float]]:
        now_s = time.time()
        return [(known, since_s) for known, since_s in self.known if abs(now_s - since_s) < LIFE_S]

    def _read(self) -> list[tuple[str, float]]:
        if self._file is None:
            return []
        try:
            return [(str(known), float(since_s)) for known, since_s in json.loads(self._file.read_text())]
        except FileNotFoundError:
            return []
        except (OSError, ValueError, TypeError) as error:  # then the token is asked for
            logger.warning("%s cannot be read (%s); browsers have to come in again", self._file, error)
            return []

    def _write(self) -> None:
        if self._file is None:
            return
        handle, temporary = tempfile.mkstemp(dir=self._file.parent, prefix=".entrants-")  # readable by its owner alone
        try:
            with open(handle, "w") as file:
                json.dump(self.known, file)
            os.replace(temporary, self._file)
        except OSError as error:
            logger.warning("%s could not be written (%s); a restart asks for a token again", self._file, error)
            with contextlib.suppress(OSError):
                os.unlink(temporary)


def _hash(cookie: str) -> str:
    return hashlib.sha256(cookie.encode()).hexdigest()
