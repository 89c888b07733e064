"""A word for an order is good once, for a minute, for whom and for what it was given."""

import asyncio
import threading

import pytest

from flight import InputError, project
from gcs_web.gateway.hub import Hub
from gcs_web.protocol.people import Person
from gcs_web.vehicle import control
from gcs_web.vehicle.control import Control

ANNA, BEN = Person("1", "Anna"), Person("2", "Ben")


@pytest.fixture
def orders(tmp_path):
    loop = asyncio.new_event_loop()
    yield Control(project.create(tmp_path / "yard", "yard"), Hub(loop), threading.RLock())
    loop.close()


@pytest.mark.parametrize(("after_s", "good"), [(0.0, True), (59.0, True), (61.0, False)])
def test_an_order_is_not_carried_out_a_minute_after_it_was_prepared(orders, monkeypatch, after_s, good):
    now_s = control.time.monotonic()
    word = orders.new_nonce(ANNA, "arm")
    monkeypatch.setattr(control.time, "monotonic", lambda: now_s + after_s)
    if good:
        orders.use_nonce(word, ANNA, "arm")
    with pytest.raises(InputError, match="before, or too long ago"):
        orders.use_nonce(word, ANNA, "arm")


@pytest.mark.parametrize(("person", "purpose"), [(BEN, "arm"), (ANNA, "kill")])
def test_a_word_is_for_one_person_and_purpose_and_gone_once_misused(orders, person, purpose):
    word = orders.new_nonce(ANNA, "arm")
    with pytest.raises(InputError, match="look at the page again"):
        orders.use_nonce(word, person, purpose)
    with pytest.raises(InputError, match="look at the page again"):
        orders.use_nonce(word, ANNA, "arm")
