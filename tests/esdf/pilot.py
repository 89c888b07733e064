"""What a pilot does to a map's edits, at random."""

from collections.abc import Callable

import numpy as np

from esdf import Edit, Editor
from flight import InputError


def step(editor: Editor, draw: Callable[[], Edit], rng: np.random.Generator) -> bool:
    """Undo, redo, drop a zone or make an edit; false if there is nothing to undo or the solid misses the map."""
    choice = rng.random()
    try:
        if choice < 0.15:
            editor.undo()
        elif choice < 0.25:
            editor.redo()
        elif choice < 0.3:
            editor.drop(f"zone {int(rng.integers(3))}")
        else:
            editor.apply(draw())
    except InputError:
        return False
    return True
