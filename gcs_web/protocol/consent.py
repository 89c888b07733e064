"""Messages about effect files of the user's own, which are code."""

from typing import Literal

import msgspec

from gcs_web.protocol.base import Command, State

EffectForm = Literal["equation", "spline", "polynomial"]


class EffectFile(msgspec.Struct, frozen=True):
    """A Python file that the vehicle file or a change that is tried names, or one in the project's folder `effects`."""

    name: str
    path: str
    sha256: str
    """Of what is shown; empty where it cannot be shown."""
    text: str
    """All of it; invisible and control characters are written as <U+202E>."""
    needed: bool
    """Whether the vehicle file, or a change that is tried, names it."""
    agreed: bool
    """Whether somebody agreed to run this text since the station was started."""
    changed: bool
    """Whether somebody agreed to another text of this file."""
    problem: str
    """Why it cannot be shown, and is therefore not run; empty for nothing."""


class EffectFiles(State, frozen=True, tag="effect_files"):
    files: list[EffectFile]


class AgreeToEffectFile(Command, frozen=True, tag="agree_to_effect_file", kw_only=True):
    """Run this text of a file from now on, until the station ends."""

    path: str
    sha256: str
    """Of the text that the page showed."""


class DraftEffect(Command, frozen=True, tag="draft_effect", kw_only=True):
    """Write an effect file of the proposed equation, or of the curve that no known effect explains; the reply has its
    name. Nothing of it is run."""

    name: str
    form: EffectForm
