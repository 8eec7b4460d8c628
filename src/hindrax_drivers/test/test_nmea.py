"""Lines, checksums and numbers of NMEA-like streams."""

import functools
import operator
import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_core.testing import chunks
from hindrax_drivers.protocols.dvl75_protocol import (
    MAX_LINE,
    LineSplitter,
    SentenceError,
    checksum,
    integer,
    number,
    numbers,
    split_verified,
)


def split(data: bytes) -> list[bytes]:
    return LineSplitter().feed(data)


@given(st.binary(max_size=MAX_LINE))
def test_the_checksum_is_the_xor_of_all_bytes(body: bytes) -> None:
    assert checksum(body) == functools.reduce(operator.xor, body, 0)


@pytest.mark.parametrize("size", [127, 128, 129, 255, 256, 257, 511, 513, MAX_LINE - 1, MAX_LINE])
def test_the_checksum_folds_bodies_of_every_length(size: int) -> None:
    body = random.Random(size).randbytes(size)
    assert checksum(body) == functools.reduce(operator.xor, body, 0)


@given(
    st.lists(st.sampled_from([b"$", b"\n", b"\r\n", b"\r", b"a", b"*7F", b"x" * 500, b"\x00"]), max_size=30),
    st.lists(st.integers(1, 700), min_size=1, max_size=8),
)
def test_any_chunking_gives_the_same_pieces(parts: list[bytes], sizes: list[int]) -> None:
    data = b"".join(parts) + b"\n"
    splitter = LineSplitter()
    assert [piece for chunk in chunks(data, sizes) for piece in splitter.feed(chunk)] == split(data)


def test_a_piece_ends_at_lf_or_cr_lf_or_before_a_dollar() -> None:
    assert split(b"one\r\n2$C\ntwo\nhalf$GPX,1*00\n\n\r\n$A$B\nrest") == [
        b"one",
        b"2",
        b"$C",
        b"two",
        b"half",
        b"$GPX,1*00",
        b"$A",
        b"$B",
    ]


def test_what_follows_an_endless_line_is_not_swallowed() -> None:
    endless = b"z" * (3 * MAX_LINE)
    assert split(endless + b"$A\n") == [b"z" * MAX_LINE] * 3 + [b"$A"]
    assert split(endless) == [b"z" * MAX_LINE] * 3, "nor kept until a line end comes"


@pytest.mark.parametrize("head", [b"$", b"a" * 500, b"$" + b"a" * 500])
def test_a_sentence_that_begins_in_a_line_without_an_end_is_whole(head: bytes) -> None:
    splitter, tail = LineSplitter(), b"$" + b"b" * 700
    assert splitter.feed(head + tail + b"$" + b"c" * 400) == [head, tail]
    assert splitter.feed(b"\n")[-1] == b"$" + b"c" * 400


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        (b"$A,1*7D", "checksum"),
        (b"$A,1*5", "no checksum"),
        (b"$A,1", "no checksum"),
        (b"$A,1*+5", "no checksum"),
        (b"$", "no checksum"),
        (b"", "no checksum"),
    ],
)
def test_refused_sentences(line: bytes, reason: str) -> None:
    with pytest.raises(SentenceError, match=f"^{reason}$"):
        split_verified(line)


def test_the_fields_of_a_sentence_come_with_its_tag_first() -> None:
    """A sentence of a GPS receiver, as Wikipedia has it under NMEA 0183."""
    line = b"$GPGGA,092750.000,5321.6802,N,00630.3372,W,1,8,1.03,61.7,M,55.2,M,,*76"
    tag, *fields = split_verified(line)
    assert (tag, len(fields), fields[:4], fields[-3:]) == (
        b"GPGGA",
        14,
        [b"092750.000", b"5321.6802", b"N", b"00630.3372"],
        [b"M", b"", b""],
    )


def test_digits_of_the_checksum_may_be_small() -> None:
    assert split_verified(b"$KJ*01") == [b"KJ"]
    assert split_verified(b"$Aj*2b") == split_verified(b"$Aj*2B") == [b"Aj"]


@pytest.mark.parametrize(
    "field", [b"", b"nan", b"inf", b"1e5", b"1_0", b" 1", b"1 ", b"--1", b"1.2.3", b"0x1", b"\xb2"]
)
def test_only_plain_notation_is_a_number(field: bytes) -> None:
    with pytest.raises(SentenceError, match="number"):
        number(field)
    with pytest.raises(SentenceError, match="number"):
        numbers([b"1.0", field])
    with pytest.raises(SentenceError, match="number"):
        integer(field)


def test_plain_numbers() -> None:
    assert (number(b"-0.5"), numbers([b"1", b"-.5"]), integer(b"-1175")) == (-0.5, [1.0, -0.5], -1175)
