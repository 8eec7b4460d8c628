"""Frames of the Ping protocol. Vectors from outside are in test/golden/ping1d."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_core.rejects import RejectCode
from hindrax_core.testing import chunks
from hindrax_drivers.protocols import ping_protocol as protocol
from hindrax_drivers.protocols.ping_protocol import FrameSplitter, PingFrame, Refused, encode

SIMPLE = encode(protocol.DISTANCE_SIMPLE, struct.pack("<IB", 1234, 95))
LONG_TEXT = b"BR\x00\x01\x03\x00"
PART = st.sampled_from(
    [
        SIMPLE,
        SIMPLE[:9],
        SIMPLE[:-1] + b"\xff",
        b"B",
        b"R",
        b"BR",
        b"\x00" * 70,
        b"BR\x18\x00\xbc\x04",
        b"BR\x00\x01\x03\x00",
    ]
)


def split(data: bytes) -> list[protocol.Piece]:
    return FrameSplitter().feed(data)


@given(st.lists(PART, max_size=20), st.lists(st.integers(1, 40), min_size=1, max_size=8))
def test_any_chunking_gives_the_same_pieces(parts: list[bytes], sizes: list[int]) -> None:
    data = b"".join(parts)
    splitter = FrameSplitter()
    assert [piece for chunk in chunks(data, sizes) for piece in splitter.feed(chunk)] == split(data)


@given(st.lists(PART, max_size=20))
def test_every_frame_that_is_not_overlapped_comes_through_and_every_byte_is_reported_once_at_most(
    parts: list[bytes],
) -> None:
    data = b"".join(parts) + b"\x00" * 1200 + SIMPLE
    pieces = split(data)
    assert pieces[-1] == PingFrame(protocol.DISTANCE_SIMPLE, SIMPLE[8:-2])
    frames = sum(one.size for one in pieces if isinstance(one, PingFrame))
    junk = sum(len(one.data) for one in pieces if isinstance(one, Refused) and one.reason is RejectCode.GARBAGE)
    assert frames + junk <= len(data)


@given(st.integers(1200, 1400), st.binary(max_size=200))
def test_what_is_encoded_is_decoded_when_its_length_is_right(message: int, payload: bytes) -> None:
    pieces = split(encode(message, payload))
    if pieces and isinstance(pieces[0], PingFrame):
        assert pieces == [PingFrame(message, payload)]
        assert pieces[0].size == len(payload) + 10
    else:
        assert isinstance(pieces[0], Refused)
        assert pieces[0].reason in (RejectCode.LENGTH, RejectCode.UNKNOWN)


def test_a_false_frame_is_reported_as_a_whole_and_once() -> None:
    broken = bytearray(SIMPLE)
    broken[9] ^= 1
    refused = Refused(RejectCode.CHECKSUM, bytes(broken))
    assert split(bytes(broken) + SIMPLE) == [refused, *split(SIMPLE)]
    assert split(bytes(broken) + bytes(3) + SIMPLE) == [refused, Refused(RejectCode.GARBAGE, bytes(3)), *split(SIMPLE)]


def test_a_flood_of_false_marks_is_cheap_and_given() -> None:
    pieces = split(b"BR" * 20_000)
    assert {one.reason if isinstance(one, Refused) else one for one in pieces} == {RejectCode.UNKNOWN}


def test_a_profile_whose_count_does_not_fit_is_none() -> None:
    head = struct.pack("<IHHIIIIH", 1000, 100, 50, 7, 0, 5000, 2, 5)
    assert protocol.echo(PingFrame(protocol.PROFILE, head + b"1234")) is None
    message = protocol.echo(PingFrame(protocol.PROFILE, head + b"12345"))
    assert message is not None
    assert message.strength == b"12345"


def test_what_a_corrupt_length_covers_comes_through_when_it_arrives() -> None:
    splitter = FrameSplitter()
    header = struct.pack("<2sHHBB", b"BR", 1000, protocol.PROFILE, 0, 0)
    arrived = [splitter.feed(part) for part in (header + bytes(40), SIMPLE, SIMPLE)]
    frame = PingFrame(protocol.DISTANCE_SIMPLE, SIMPLE[8:-2])
    assert [[one for one in pieces if isinstance(one, PingFrame)] for pieces in arrived] == [[], [frame], [frame]]
    assert [one.reason for one in arrived[1] if isinstance(one, Refused)] == [RejectCode.LENGTH, RejectCode.GARBAGE]


def garbage(pieces: list[protocol.Piece]) -> list[int]:
    """Lengths of what is told as garbage."""
    return [len(one.data) for one in pieces if isinstance(one, Refused) and one.reason is RejectCode.GARBAGE]


def test_garbage_is_reported_sixty_four_bytes_at_a_time() -> None:
    assert garbage(split(bytes(63))) == []
    assert garbage(split(bytes(64))) == [64]
    assert garbage(split(bytes(130) + SIMPLE)) == [64, 64, 2]


def test_what_follows_a_frame_inside_of_a_false_one_is_garbage_again() -> None:
    pieces = split(b"BR" + SIMPLE + bytes(64))
    assert [one.reason for one in pieces if isinstance(one, Refused)] == [RejectCode.LENGTH, RejectCode.GARBAGE]
    assert garbage(pieces) == [64]


LENGTHS = {4: 6, 5: 4, 1201: 1, 1202: 2, 1203: 4, 1204: 8, 1205: 1, 1206: 2, 1207: 4, 1208: 2}
LENGTHS |= {1200: 6, 1210: 10, 1211: 5, 1212: 24, 1213: 2, 1214: 2, 1215: 1}
"""Payload by message: common.json and ping1d.json of ping-protocol."""


@pytest.mark.parametrize(("message", "size"), LENGTHS.items())
def test_every_message_has_the_length_of_its_definition_and_no_other(message: int, size: int) -> None:
    assert split(encode(message, bytes(size))) == [PingFrame(message, bytes(size))]
    for wrong in (size - 1, size + 1):
        assert not any(isinstance(one, PingFrame) for one in split(encode(message, bytes(wrong))))


@pytest.mark.parametrize(
    ("message", "shortest", "longest"),
    [(protocol.ACK, 2, 2), (protocol.NACK, 2, 258), (protocol.TEXT, 0, 256), (protocol.PROFILE, 26, 26 + 1024)],
)
def test_a_message_of_any_length_has_its_head_and_an_end(message: int, shortest: int, longest: int) -> None:
    for size in {shortest, longest}:
        assert split(encode(message, bytes(size))) == [PingFrame(message, bytes(size))]
    for wrong in {max(0, shortest - 1), longest + 1} - {shortest}:
        assert not any(isinstance(one, PingFrame) for one in split(encode(message, bytes(wrong))))


@pytest.mark.parametrize(("message", "reason"), [(protocol.DISTANCE_SIMPLE, "length"), (1999, "unknown")])
@pytest.mark.parametrize("length", [0, 1, 3])
def test_a_known_message_of_a_wrong_length_is_distinguished_from_an_unknown_one(
    message: int, reason: str, length: int
) -> None:
    (refused, *_) = split(encode(message, bytes(length)))
    assert isinstance(refused, Refused)
    assert refused.reason == reason
