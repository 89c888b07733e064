"""The generated code is what the XML says, and pymavlink's own generator agrees with ours."""

from pathlib import Path

import hypothesis.strategies as st
import pytest
from hypothesis import given
from pymavlink.dialects.v20 import all as public_messages
from pymavlink.generator import mavparse

from firmware_bridge import _controller
from firmware_bridge.dialect import generate
from firmware_bridge.dialect.generated import autopilot_messages
from firmware_bridge.dialect.generated import messages as m

REASONS_OF_THE_LINK = range(70, 100)


def test_committed_files_are_what_the_generator_writes():
    definitions, enums = generate.read(generate.HERE / "goshawk.xml")
    assert generate.HEADER.read_text() == generate.header(definitions, enums)
    assert generate.PYTHON.read_text() == generate.python(definitions, enums)
    more = generate.read(generate.HERE / "autopilot.xml")
    assert generate.AUTOPILOT.read_text() == generate.python(*more, source="autopilot.xml")


def _parsed(name: str) -> mavparse.MAVXML:
    return mavparse.MAVXML(str(generate.HERE / name), mavparse.PROTOCOL_2_0)


@pytest.mark.parametrize("name", ["standard.xml", "goshawk.xml"])
def test_layout_and_crc_extra_agree_with_pymavlinks_generator(name: str):
    theirs = _parsed(name).message
    assert theirs
    for message in theirs:
        ours = m.BY_ID[message.id]
        assert message.crc_extra == ours.CRC_EXTRA, message.name
        assert ours.STRUCT.size == message.wire_length, message.name
        assert list(ours.__slots__) == [field.name for field in message.ordered_fields], message.name


def test_standard_messages_are_the_public_ones():
    parsed = [*_parsed("standard.xml").message, *_parsed("autopilot.xml").message]
    known = [x for x in parsed if x.id in public_messages.mavlink_map]
    assert len(known) >= 12  # ESC_STATUS is newer than some copies
    for message in known:
        public = public_messages.mavlink_map[message.id]
        ours = {**m.BY_ID, **autopilot_messages.BY_ID}[message.id]
        assert (public.msgname, public.crc_extra) == (message.name, ours.CRC_EXTRA)
        named = public.ordered_fieldnames  # older copies lack the newest extensions
        assert named == list(ours.__slots__)[: len(named)]


def test_protocol_version_is_the_public_one():
    """Which pymavlink's copies no longer have and QGroundControl asks for; 217 is in the published C headers."""
    assert (m.ProtocolVersion.ID, m.ProtocolVersion.CRC_EXTRA, m.ProtocolVersion.STRUCT.size) == (300, 217, 22)


def test_dialect_ids_collide_with_no_public_message():
    own = {message.id for message in _parsed("goshawk.xml").message}
    assert min(own) >= 54000
    assert not own & set(public_messages.mavlink_map)


def test_every_message_survives_packing():
    for kind in m.BY_ID.values():
        message = kind.unpack(bytes(i % 120 + 1 for i in range(kind.STRUCT.size)))
        assert kind.unpack(message.pack()) == message, kind.__name__


@given(st.lists(st.floats(width=32, allow_nan=False), min_size=48, max_size=48), st.integers(0, 2**16 - 1))
def test_a_segment_survives_packing_whatever_its_zeros(coefficients: list[float], index: int):
    segment = m.TrajectorySegment(transfer_id=7, index=index, coefficients=tuple(coefficients))
    assert m.TrajectorySegment.unpack(segment.pack()) == segment


def test_short_trajectories_send_short_segments():
    segment = m.TrajectorySegment(index=1, target_system=1, target_component=1, coefficients=(1.0,) * 32 + (0.0,) * 16)
    assert len(segment.pack()) == m.TrajectorySegment.STRUCT.size - 64


def test_mission_states_and_reasons_are_those_of_the_c_headers():
    for state in m.MissionState:
        words = _controller.state_text(state).lower().replace("-", "").replace(" ", "")
        assert words == state.name.lower().replace("_", "")
    header = (Path(generate.HERE).parent / "controller" / "include" / "goshawk_controller" / "link.h").read_text()
    for reason in m.LinkReason:
        assert f"TC_LINK_{reason.name} = {reason.value}" in header
        assert reason in REASONS_OF_THE_LINK
