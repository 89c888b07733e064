"""MSP version 2: what is sent comes out again, however the line cuts or damages it."""

from hypothesis import given
from hypothesis import strategies as st

from firmware_bridge.offboard.msp import ANSWER, REFUSED, REQUEST, Decoder, Frame, crc8_dvb_s2, encode

frames = st.builds(Frame, st.integers(0, 0xFFFF), st.binary(max_size=300), st.sampled_from([REQUEST, ANSWER, REFUSED]))


@given(st.lists(frames, max_size=5), st.integers(1, 50))
def test_frames_survive_a_line_that_cuts_them_anywhere(sent, piece):
    data, decoder = b"".join(map(encode, sent)), Decoder()
    got = [frame for i in range(0, len(data), piece) for frame in decoder.feed(data[i : i + piece])]
    assert got == sent
    assert decoder.damaged == 0


@given(frames, st.data())
def test_a_damaged_byte_never_gives_another_frame(frame, data):
    content = bytearray(encode(frame))
    place = data.draw(st.integers(3, len(content) - 1))
    content[place] ^= data.draw(st.integers(1, 255))
    whole = encode(Frame(1, b"after"))
    got = list(Decoder().feed(bytes(content) + whole * 20))
    assert all(found == Frame(1, b"after") for found in got)


def test_the_checksum_is_that_of_the_standard():
    assert crc8_dvb_s2(b"123456789") == 0xBC  # the catalogue's check value


def test_noise_before_a_frame_is_skipped():
    assert list(Decoder().feed(b"# garbage $ $M" + encode(Frame(108, b"ok")))) == [Frame(108, b"ok")]
