"""What each panel lists: its commands, and the function that does each."""

from collections.abc import Callable, Mapping
from typing import Any

from gcs_web.desk import Desk
from gcs_web.protocol.base import Command
from gcs_web.protocol.people import Person
from gcs_web.protocol.reply import Reply

Handlers = Mapping[type[Command], Callable[[Desk, Person, Any], Reply | None]]
"""A function does a command; a reply only where it has something to say. Raises `FlightError` to refuse it."""
