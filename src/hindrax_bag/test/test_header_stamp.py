"""The stamp of a message out of its bytes: where it lies, and when there is none."""

import struct

import pytest

from hindrax_bag.read.bag_reader import stamp_of, valid_stamp

LITTLE, BIG = b"\x00\x01\x00\x00", b"\x00\x00\x00\x00"
NS = 1_000_000_000


@pytest.mark.parametrize(
    ("head", "seconds", "nanoseconds", "stamp"),
    [
        (LITTLE, 0, 0, 0),
        (LITTLE, 7, 5, 7 * NS + 5),
        (LITTLE, 2**31 - 1, NS - 1, 2**31 * NS - 1),
        (LITTLE, 7, NS, None),
        (LITTLE, -1, 0, None),
        (BIG, 7, 5, None),
        (b"\x00\x03\x00\x00", 7, 5, None),
    ],
)
def test_a_time_since_1970_follows_the_head_of_a_little_endian_message(
    head: bytes, seconds: int, nanoseconds: int, stamp: int | None
) -> None:
    data = head + struct.pack("<iI", seconds, nanoseconds)
    assert valid_stamp(data) == valid_stamp(data + b"and more") == stamp
    assert stamp_of(data) == seconds * NS + nanoseconds
    assert all(valid_stamp(data[:length]) is None for length in range(len(data)))
