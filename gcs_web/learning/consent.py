"""Effect files of the user's own are code: which the project names, what they say, and which somebody agreed to run.

Consent is to a text, by its SHA-256, and lasts as long as the station: it is kept nowhere, because a project folder
that came from somebody else could bring it along. `vehicle.effects.run_only` holds all of the station to it, with every
process that it starts.
"""

import hashlib
import io
import threading
import tokenize
import unicodedata
from pathlib import Path

import vehicle
from flight import FlightError, InputError
from flight.project import Project
from gcs_web.learning.learning import own_effects, tried_files
from gcs_web.protocol.consent import EffectFile

LARGEST_BYTES = 200_000
"""What is longer is not shown, and not run."""
MOST_OWN = 30
"""Files of the folder `effects` that are listed, in the order of their names."""
_INVISIBLE = ("Cc", "Cf", "Co", "Cs", "Cn", "Zl", "Zp")
"""Unicode's categories of characters that show nothing, or turn the direction of what follows."""


def named(opened: Project) -> dict[Path, bool]:
    """Effect files of the project, and whether its vehicle file or a change that is tried names them; none is run."""
    found: dict[Path, bool] = {}
    for path in (opened.vehicle, tried_files(opened.folder)[0]):
        try:
            found |= dict.fromkeys(vehicle.effect_files(path), True)
        except FlightError:  # said where the vehicle itself is read
            continue
    own = sorted(path.resolve() for path in own_effects(opened.folder).glob("*.py"))
    return dict.fromkeys(own[:MOST_OWN], False) | found


class Consent:
    """Thread-safe."""

    def __init__(self, opened: Project) -> None:
        """From now on this process runs no effect file that nobody agreed to."""
        self._project = opened
        self._lock = threading.Lock()
        self._agreed: dict[str, set[str]] = {}
        """By path, the SHA-256 that somebody agreed to."""
        self._before, self._known = vehicle.effects.agreed(), vehicle.effects.from_files()
        vehicle.effects.run_only(())

    def close(self) -> None:
        """As it was before, also without this project's effects: the next one may have others of their names."""
        vehicle.effects.forget_files(vehicle.effects.from_files() - self._known)
        if self._before is None:
            vehicle.effects.run_any()
        else:
            vehicle.effects.run_only(self._before)

    def files(self) -> list[EffectFile]:
        with self._lock:
            return self._files()

    def agree(self, path: str, sha256: str) -> EffectFile:
        """Let this text run.

        Raises:
            InputError: the project names no such file, or it says something else now.
        """
        with self._lock:
            file = next((one for one in self._files() if one.path == path), None)
            if file is None:
                raise InputError(f"{path!r} is no effect file of this project (any more)")
            if file.problem:
                raise InputError(f"{path}: {file.problem}")
            if file.sha256 != sha256:
                raise InputError(f"{file.name} was changed since it was shown; read it again")
            self._agreed.setdefault(path, set()).add(sha256)
            vehicle.effects.run_only(set().union(*self._agreed.values()))
        return file

    def _files(self) -> list[EffectFile]:
        return [self._shown(path, needed=needed) for path, needed in named(self._project).items()]

    def _shown(self, path: Path, *, needed: bool) -> EffectFile:
        text, sha256, problem = "", "", ""
        try:
            data = _read(path)
            text, sha256 = visible(data.decode()), hashlib.sha256(data).hexdigest()
        except (UnicodeDecodeError, SyntaxError):
            problem = "it is not UTF-8 text, so what it says cannot be shown; it is not run"
        except (InputError, OSError) as error:
            problem = str(error)
        agreed = self._agreed.get(str(path), set[str]())
        return EffectFile(
            path.name, str(path), sha256, text, needed, sha256 in agreed, bool(agreed) and sha256 not in agreed, problem
        )


def _read(path: Path) -> bytes:
    """Only what looks like an effect: the page must not show any file that a vehicle file cares to name."""
    if path.suffix != ".py" or not path.is_file():
        raise InputError("it is no Python file, or is not there; it is not run")
    with open(path, "rb") as file:
        data = file.read(LARGEST_BYTES + 1)
    if len(data) > LARGEST_BYTES:
        raise InputError(f"it has more than {LARGEST_BYTES} bytes, which nobody reads; it is not run")
    encoding, _ = tokenize.detect_encoding(io.BytesIO(data).readline)
    if not encoding.startswith("utf-8"):  # Python would run another text than the one that is shown
        raise InputError(f"its first lines say that it is {encoding}, not UTF-8; it is not run")
    return data


def visible(text: str) -> str:
    """The text with every character that shows nothing written out; lines end as they do."""
    return "".join(_visible(character) for character in text.replace("\r\n", "\n"))


def _visible(character: str) -> str:
    hidden = character not in "\n\t" and unicodedata.category(character) in _INVISIBLE
    return f"<U+{ord(character):04X}>" if hidden else character
