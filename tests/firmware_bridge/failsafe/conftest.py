"""The simulated body, built once, and the folder of its harness on the path: test files here import it by name."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import harness


@pytest.fixture(scope="session")
def body() -> harness.Body:
    return harness.load()
