"""The MAVLink decoder: chunking, garbage, damage."""

from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import common

from hindrax_core.events import Rejected, Stamp
from hindrax_core.readings import AppliedPulses
from hindrax_core.testing import chunks
from hindrax_drivers.protocols.mavlink import CommandAck, Decoder, Heartbeat, MavlinkFrame, Message, encode, heartbeat

NOW = Stamp(7)
BOARD = common.MAVLink(None, srcSystem=1, srcComponent=1)
FRAMES: dict[Message, bytes] = {
    message: bytes(theirs.pack(BOARD))
    for message, theirs in (
        (Heartbeat(12, armed=True), BOARD.heartbeat_encode(12, 0, 128, 0, 4)),
        (CommandAck(400, 1, 0, 0), BOARD.command_ack_encode(400, 1)),
        (AppliedPulses((1500.0,) * 16), BOARD.servo_output_raw_encode(9, 0, *[1500] * 16)),
    )
}
"""Messages, and their frames as others write them."""
MESSAGES = st.sampled_from(list(FRAMES))
PIECES = st.lists(st.one_of(st.binary(max_size=80), MESSAGES), max_size=12)
BEAT = bytes(BOARD.heartbeat_encode(12, 0, 0, 0, 3).pack(BOARD))


def wire(pieces: list[bytes | Message]) -> bytes:
    return b"".join(piece if isinstance(piece, bytes) else FRAMES[piece] for piece in pieces)


def events(data: bytes, sizes: list[int]) -> list[MavlinkFrame | Rejected]:
    decoder = Decoder()
    return [event for piece in chunks(data, sizes) for event in decoder.feed(piece, NOW)]


@given(PIECES, st.lists(st.integers(1, 90), min_size=1, max_size=8))
def test_any_cutting_of_any_stream_gives_the_same_events(pieces: list[bytes | Message], sizes: list[int]) -> None:
    data = wire(pieces)
    assert events(data, sizes) == events(data, [len(data)])


@given(PIECES)
def test_every_frame_among_garbage_is_found_and_every_other_byte_is_accounted_for(
    pieces: list[bytes | Message],
) -> None:
    data = wire(pieces) + bytes(100)
    found = events(data, [len(data)])
    sent = [piece for piece in pieces if not isinstance(piece, bytes)]
    assert [event.message for event in found if isinstance(event, MavlinkFrame)] == sent
    refused = sum(len(event.data) for event in found if isinstance(event, Rejected))
    frames = sum(len(FRAMES[message]) for message in sent)
    assert 0 <= len(data) - refused - frames < 64


@given(MESSAGES, st.data())
def test_a_frame_with_a_flipped_bit_is_never_a_message(message: Message, data: st.DataObject) -> None:
    good = bytearray(FRAMES[message])
    bit = data.draw(st.integers(0, len(good) * 8 - 1))
    good[bit // 8] ^= 1 << bit % 8
    assert not any(isinstance(event, MavlinkFrame) for event in events(bytes(good) + bytes(100), [999]))


def test_a_frame_after_a_stray_start_byte_and_a_false_length_is_not_lost() -> None:
    data = b"\xfd\xff" + BEAT + b"\xfd\x09\x00" + BEAT + BEAT + b"\xfd" + BEAT
    assert sum(isinstance(event, MavlinkFrame) for event in events(data, [1])) == 4


def test_bytes_without_any_start_are_refused_to_the_last() -> None:
    assert events(bytes(64), [64]) == [Rejected(NOW, "no start of a frame", bytes(64))]


def test_refusals_say_why() -> None:
    unknown = b"\xfd\x01\x00\x00\x00\x01\x01\xe8\x03\x00\x00\x00\x00"
    long = b"\xfd\x30\x00\x00\x00\x01\x01\x00\x00\x00"
    damaged = BEAT[:-1] + bytes([BEAT[-1] ^ 1])
    signed = BEAT[:2] + b"\x01" + BEAT[3:]
    reasons = []
    for bad in (unknown, long, damaged, signed, b"hello"):
        first, second = events(bad + BEAT, [999])
        assert isinstance(first, Rejected)
        assert isinstance(second, MavlinkFrame)
        assert first.data == bad
        reasons.append(first.reason)
    assert reasons == [
        "unknown message 1000",
        "impossible length for message 0",
        "checksum",
        "signed, or of a later version",
        "no start of a frame",
    ]


def test_our_heartbeat_is_read_by_pymavlink_as_that_of_an_onboard_computer() -> None:
    reader = common.MAVLink(None)
    (beat,) = reader.parse_buffer(encode(heartbeat(18, 8, 4), 7))
    assert (beat.get_srcSystem(), beat.get_srcComponent(), beat.get_seq()) == (1, 191, 7)
    assert (beat.type, beat.autopilot, beat.base_mode, beat.system_status) == (18, 8, 0, 4)
    assert (beat.custom_mode, beat.mavlink_version) == (0, 3)
