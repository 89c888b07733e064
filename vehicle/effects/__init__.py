"""The catalogue: every effect a vehicle model may contain, one file each; and effects of the user's own."""

import difflib
import hashlib
import importlib
import importlib.util
import os
import pkgutil
from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from flight import FormatError, InputError, errors
from vehicle.effects import base
from vehicle.effects.base import Effect, Values

__all__ = [
    "Effect",
    "agreed",
    "catalogue",
    "find",
    "forget_files",
    "from_files",
    "load_file",
    "register",
    "run_any",
    "run_only",
    "text_hash",
]

_registered: dict[str, Effect] = {}
_AGREED = "GOSHAWK_AGREED_EFFECT_FILES"
"""Environment variable, so that processes started from this one obey it too: SHA-256 of the files that may be run, with
spaces between them. Unset: any."""
_origins: dict[str, tuple[Path, bytes]] = {}
"""File and text of each of the user's own effects."""


@cache
def catalogue() -> dict[str, Effect]:
    """Every effect that comes with the package, by name, in the order of the catalogue."""
    files = [m.name for m in pkgutil.walk_packages(__path__, f"{__name__}.") if not m.ispkg and m.name != base.__name__]
    found = [importlib.import_module(name).EFFECT for name in files]
    return {effect.name: effect for effect in sorted(found, key=lambda e: (e.number, e.name))}


def find(name: str, rotors: int = 4) -> Effect:
    """The effect of this name, as on a vehicle of so many rotors: the user's own first, then the catalogue.

    Raises:
        InputError: there is none.
    """
    effect = _registered.get(name) or catalogue().get(name)
    if effect is None:
        known = [*_registered, *catalogue()]
        raise InputError(f"there is no effect named {name!r}; {hint(name, known, 'goshawk vehicle schema')}")
    return effect if rotors == 4 or effect.each_rotor is None else _of_rotors(effect, rotors)


@cache
def _of_rotors(effect: Effect, rotors: int) -> Effect:
    assert effect.each_rotor is not None
    return replace(effect, parameters=effect.each_rotor(rotors))


def hint(name: str, known: Iterable[str], verb: str) -> str:
    """The way out for an unknown name: similar ones, else the verb that lists all."""
    found = _near(name, list(known))
    return f"near it: {', '.join(found)}" if found else f"`{verb}` lists all"


def _near(name: str, known: list[str]) -> list[str]:
    """Similar names: of similar spelling, or with all the words that were given."""
    words = [word for word in name.lower().replace("-", "_").split("_") if word]
    with_words = [k for k in known if words and all(word in k for word in words)]
    alike = difflib.get_close_matches(name.lower(), known, n=3, cutoff=0.6)
    return list(dict.fromkeys([*with_words, *alike]))[:4]


def register(effect: Effect) -> Effect:
    """Register an effect of your own under its name.

    Raises:
        InputError: the catalogue already uses the name.
    """
    if effect.name in catalogue():
        raise InputError(f"the name {effect.name!r} is taken by the catalogue; choose another")
    _registered[effect.name] = effect
    return effect


def run_only(agreed: Iterable[str]) -> None:
    """From now on run no other effect files than those of these SHA-256, here and in processes started from here."""
    os.environ[_AGREED] = " ".join(sorted(agreed))


def run_any() -> None:
    """Run effect files without asking, as the command line does."""
    os.environ.pop(_AGREED, None)


def agreed() -> tuple[str, ...] | None:
    """SHA-256 of the effect files that may be run; None: any."""
    listed = os.environ.get(_AGREED)
    return None if listed is None else tuple(listed.split())


def from_files() -> frozenset[str]:
    """Names of the effects that came from files."""
    return frozenset(_origins)


def forget_files(names: Iterable[str]) -> None:
    """Take back effects that came from files; who needs them reads the files again."""
    for name in names:
        if _origins.pop(name, None) is not None:
            _registered.pop(name, None)


def load_file(path: Path) -> Effect:
    """Read one Python file that defines `EFFECT`, and register it.

    Raises:
        InputError: there is no such file, nobody agreed to run it (`run_only`), or another file already defines an
            effect of that name in another way.
        FormatError: it does not run, or defines no `EFFECT`.
    """
    path = Path(path).resolve()
    if not path.is_file():
        raise errors.missing(path, "an effect in Python")
    text = path.read_bytes()  # once: what is hashed is what runs
    _check_agreed(path, text)
    spec = importlib.util.spec_from_file_location(f"goshawk_effect_{path.stem}", path)
    if spec is None:
        raise FormatError(f"effect file {path} is not a Python file")
    module = importlib.util.module_from_spec(spec)
    try:
        # not exec_module, which leaves compiled files beside the user's
        exec(compile(text, path, "exec"), module.__dict__)
    except Exception as error:
        raise FormatError(f"effect file {path} does not run: {error}") from error
    effect = getattr(module, "EFFECT", None)
    if not isinstance(effect, Effect):
        raise FormatError(f"effect file {path} defines no EFFECT = Effect(...)")
    _check_origin(effect, path, text)
    return register(replace(effect, apply=_guarded(effect, path)))


def _guarded(effect: Effect, path: Path) -> Callable[[Any, Values], None]:
    """Its law; an error of the user's code becomes one that names effect and file, in whatever verb it is called."""

    def apply(state: Any, values: Values) -> None:
        try:
            effect.apply(state, values)
        except Exception as error:
            raise InputError(f"effect {effect.name} failed: {type(error).__name__}: {error}; mend {path}") from error

    return apply


def origin(name: str) -> Path | None:
    """The file that one of the user's own effects came from; None for the catalogue's."""
    return _origins[name][0] if name in _registered and name in _origins else None


def text_hash(name: str) -> str:
    """SHA-256 of the text that defined one of the user's own effects, whatever its line endings; empty for the
    catalogue's."""
    if origin(name) is None:
        return ""
    return hashlib.sha256(_origins[name][1].replace(b"\r\n", b"\n")).hexdigest()


def _check_agreed(path: Path, text: bytes) -> None:
    digest, may_run = hashlib.sha256(text).hexdigest(), agreed()
    if may_run is not None and digest not in may_run:
        raise InputError(
            f"effect file {path} (SHA-256 {digest[:12]}) is code, and nobody has agreed to run it; read it on the "
            "ground station's page and agree there"
        )


def _check_origin(effect: Effect, path: Path, text: bytes) -> None:
    """Vehicle files refer to effects by name: two different ones of one name would be confused without a message."""
    known, known_text = _origins.get(effect.name, (path, text))
    if known != path and known_text != text:
        raise InputError(f"{path} defines effect {effect.name!r}, and so does {known}, differently; rename one")
    _origins[effect.name] = (path, text)
