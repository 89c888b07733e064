"""A station that does not open or close says why."""

import socket

import pytest

from flight import InputError
from gcs_web import GroundStation
from gcs_web.gateway import gateway
from tests.gcs_web.station_process import new_project


@pytest.fixture
def slow_to_close(monkeypatch):
    """The gateway's end is reported as late."""
    stop = gateway.Gateway.stop

    async def stopped_late(self: gateway.Gateway) -> None:
        await stop(self)
        raise TimeoutError

    monkeypatch.setattr(gateway.Gateway, "stop", stopped_late)


def test_an_error_of_the_body_is_not_hidden_by_one_of_closing(pillar_map, tmp_path, slow_to_close, caplog):
    new_project(tmp_path / "hall", pillar_map, name="hall")
    with pytest.raises(KeyError, match="first"), GroundStation(tmp_path / "hall", triangles=500):
        raise KeyError("first")
    assert "not closed properly: TimeoutError()" in caplog.text
    with pytest.raises(TimeoutError), GroundStation(tmp_path / "hall", triangles=500):
        pass


def test_why_a_station_does_not_open_is_not_hidden_by_an_error_of_closing(pillar_map, tmp_path, slow_to_close):
    new_project(tmp_path / "hall", pillar_map, name="hall")
    with socket.create_server(("127.0.0.1", 0)) as taken, pytest.raises(InputError, match="cannot be used"):
        GroundStation(tmp_path / "hall", triangles=500, port=taken.getsockname()[1])
