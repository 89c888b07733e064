"""Who may give orders to the vehicle: one person in control, words that are good once, and the audit log."""

import json
import secrets
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime

from flight import InputError
from flight.project import Project
from gcs_web.gateway.hub import Hub
from gcs_web.protocol.people import Notice, People, Person
from gcs_web.vehicle.watch import Watch

NONCE_LIFE_S = 60.0


@dataclass(frozen=True, slots=True)
class _Nonce:
    person: str
    purpose: str
    given_s: float


class Control:
    """Thread-safe."""

    def __init__(self, opened: Project, hub: Hub, lock: threading.RLock) -> None:
        """`lock`: held by who must know that nobody takes control meanwhile."""
        self._folder, self._hub, self._lock = opened.folder, hub, lock
        self.watch: Watch | None = None
        self.holder = ""
        """Id of the person whose orders are passed on to the vehicle."""
        self.is_left = False
        """From when another project is to be opened: nobody takes control of the vehicle here any more."""
        self._nonces: dict[str, _Nonce] = {}

    def show(self) -> None:
        self._hub.publish(People(self._hub.people, self.holder))

    def take(self, person: Person, *, force: bool) -> None:
        """
        Raises:
            InputError: somebody else has control, and `force` was not given; or another project is being opened.
        """
        with self._lock:
            if self.is_left:
                raise InputError("another project is being opened; take control there")
            if self.holder not in ("", person.id) and not force:
                raise InputError(f"{self._name()} is in control; ask for it, or take it over")
            if self.holder not in ("", person.id):
                self._hub.publish(Notice(f"{person.name} took over control of the vehicle", "caution"), self.holder)
            self.holder = person.id
        self.show()

    def give_up(self, person: Person) -> None:
        with self._lock:
            if self.holder == person.id:
                self.holder = ""
        self.show()

    def required(self, person: Person) -> Watch:
        """The vehicle, for the person in control.

        Raises:
            InputError: there is no vehicle, or this person is not in control.
        """
        if self.watch is None:
            raise InputError("no vehicle is connected; connect to one in step 3, Fly")
        if self.holder != person.id:
            whose = f"{self._name()} is in control" if self.holder else "nobody is in control"
            raise InputError(f"{whose}; take control first")
        return self.watch

    def new_nonce(self, person: Person, purpose: str) -> str:
        """A word that is good once, for this person and purpose, for a minute."""
        with self._lock:
            now_s = time.monotonic()
            self._nonces = {k: n for k, n in self._nonces.items() if now_s - n.given_s < NONCE_LIFE_S}
            word = secrets.token_urlsafe(16)
            self._nonces[word] = _Nonce(person.id, purpose, now_s)
            return word

    def use_nonce(self, word: str, person: Person, purpose: str) -> None:
        """
        Raises:
            InputError: it was used before, is too old, or was given to somebody else or for something else.
        """
        with self._lock:
            known = self._nonces.pop(word, None)
        if (
            known is None
            or (known.person, known.purpose) != (person.id, purpose)
            or time.monotonic() - known.given_s > NONCE_LIFE_S
        ):
            raise InputError("this order was given before, or too long ago; look at the page again and repeat it")

    def audit(self, person: Person, what: str, answer: str, about: dict[str, object]) -> None:
        """One line for whoever asks later: who ordered what, about which plan, and what came of it."""
        now = datetime.now(UTC).isoformat(timespec="milliseconds")
        line = {"time": now, "who": person.name, "what": what, **about, "answer": answer}
        try:
            with self._lock, open(self._folder / ".session" / "audit.jsonl", "a") as log:
                log.write(json.dumps(line) + "\n")
        except OSError as error:  # the order was carried out all the same
            self._hub.publish(Notice(f"the audit log could not be written: {error.strerror}", "danger"))

    def audited(self, person: Person, what: str, do: Callable[[], None], about: dict[str, object]) -> None:
        """Do what a person ordered, and write down what came of it.

        Args:
            about: of `audit`, as it was when the order was given.
        """
        try:
            do()
        except Exception as error:
            self.audit(person, what, f"refused: {error}", about)
            raise
        self.audit(person, what, "done", about)

    def require_free(self, but_for: str = "") -> None:
        """
        Raises:
            InputError: somebody is in control, other than the person of this id.
        """
        if self.holder not in ("", but_for):
            raise InputError(f"{self._name()} is in control; give up control first")

    def _name(self) -> str:
        return next((p.name for p in self._hub.people if p.id == self.holder), "somebody who left")
