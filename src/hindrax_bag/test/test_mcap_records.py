"""Records of files made by hand from the MCAP specification: what is whole is read, what is not is told."""

import struct
import zlib
from pathlib import Path
from typing import Any

import lz4.frame
import pytest
import zstandard
from mcap.records import Channel, Footer, Header, Message, Schema
from mcap.writer import MCAP0_MAGIC as MAGIC

from hindrax_bag.read.mcap_records import MOST_B, Damage, records
from hindrax_core.errors import UsageError

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, STATISTICS = 1, 2, 3, 4, 5, 6, 11
START, END = 10_000_000_000, 12_500_000_000
"""Times of the chunk [ns]."""


def record(code: int, body: bytes) -> bytes:
    return struct.pack("<BQ", code, len(body)) + body


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


def message(number: int, data: bytes = b"data") -> bytes:
    return record(MESSAGE, struct.pack("<HIQQ", 7, number, START + number, START - number) + data)


def chunk(inner: bytes, kind: str = "", *, claims: int | None = None, crc: int | None = None) -> bytes:
    packed = {"": bytes, "lz4": lz4.frame.compress, "zstd": zstandard.compress}.get(kind, bytes)(inner)
    head = struct.pack("<QQQ", START, END, len(inner) if claims is None else claims)
    crc = zlib.crc32(inner) if crc is None else crc
    return record(CHUNK, head + struct.pack("<I", crc) + text(kind) + struct.pack("<Q", len(packed)) + packed)


HEAD = record(HEADER, text("ros2") + text("by hand"))
FOOT = record(FOOTER, bytes(20))
TYPE = record(SCHEMA, struct.pack("<H", 1) + text("std_msgs/msg/Empty") + text("ros2msg") + text(""))
TOPIC = record(CHANNEL, struct.pack("<HH", 7, 1) + text("/topic") + text("cdr") + struct.pack("<I", 0))


def read(tmp_path: Path, content: bytes, **options: Any) -> tuple[list[Any], Damage]:
    file, damage = tmp_path / "a.mcap", Damage()
    file.write_bytes(content)
    return list(records(file, damage, **options)), damage


def kinds(found: list[Any]) -> list[type]:
    return [type(one) for one in found]


@pytest.mark.parametrize("kind", ["", "lz4", "zstd"])
def test_a_finished_file_is_read_in_the_order_in_which_it_was_written(kind: str, tmp_path: Path) -> None:
    inner = TYPE + TOPIC + record(STATISTICS, b"?") + message(3) + message(1, b"")
    found, damage = read(tmp_path, MAGIC + HEAD + message(2, b"alone") + chunk(inner, kind) + FOOT + MAGIC)
    assert kinds(found) == [Header, Message, Schema, Channel, Message, Message, Footer]
    assert [(one.channel_id, one.sequence, one.log_time, one.publish_time, one.data) for one in found[4:6]] == [
        (7, 3, START + 3, START - 3, b"data"),
        (7, 1, START + 1, START - 1, b""),
    ]
    assert found[1].data == b"alone"
    assert found[2].name == "std_msgs/msg/Empty"
    assert found[3].topic == "/topic"
    assert damage == Damage()


def test_chunks_and_messages_may_be_passed_over_and_what_nobody_needs_always_is(tmp_path: Path) -> None:
    unknown = record(STATISTICS, b"no statistics") + record(0x80, b"of somebody")
    content = MAGIC + HEAD + message(2) + chunk(message(1)) + unknown + TYPE + FOOT
    found, damage = read(tmp_path, content, chunks=False)
    assert kinds(found) == [Header, Schema, Footer]
    assert damage == Damage()


def test_nothing_is_read_behind_the_footer(tmp_path: Path) -> None:
    found, damage = read(tmp_path, MAGIC + HEAD + FOOT + message(1))
    assert kinds(found) == [Header, Footer]
    assert damage == Damage()


@pytest.mark.parametrize("start", [b"", MAGIC[:1], MAGIC[:-1], MAGIC, MAGIC + HEAD])
def test_a_file_that_only_began_is_unfinished_and_not_damaged(start: bytes, tmp_path: Path) -> None:
    found, damage = read(tmp_path, start)
    assert kinds(found) == [Header] * (HEAD in start)
    assert damage == Damage(unfinished=True)


@pytest.mark.parametrize("start", [b"x", b"\x88", MAGIC[:-1] + b"x", b"SQLite format 3\0"])
def test_another_kind_of_file_is_refused(start: bytes, tmp_path: Path) -> None:
    if MAGIC.startswith(start):
        pytest.skip("the beginning of a bag")
    with pytest.raises(UsageError, match=r"a\.mcap: is no MCAP file"):
        read(tmp_path, start)


def test_the_reader_works_without_somebody_who_asks_for_the_damage(tmp_path: Path) -> None:
    file = tmp_path / "a.mcap"
    file.write_bytes(MAGIC + HEAD + b"\x05")
    assert kinds(list(records(file))) == [Header]


def lost(note: str, *, left_out: int, seconds: float = 2.5, unfinished: bool = False) -> Damage:
    return Damage([f"a.mcap: {note}"], seconds, unfinished, left_out)


@pytest.mark.parametrize(
    ("broken", "why"),
    [
        (chunk(message(1), crc=99), "CRCValidationError"),
        (chunk(message(1), "zstd", claims=1), "ValueError"),
        (chunk(message(1), "lz4", claims=1000), "ValueError"),
        (chunk(message(1), claims=0), "ValueError"),
        (chunk(message(1), "zip"), "UnsupportedCompressionError"),
    ],
)
def test_a_broken_chunk_costs_itself_and_its_time(broken: bytes, why: str, tmp_path: Path) -> None:
    found, damage = read(tmp_path, MAGIC + HEAD + broken + message(2) + FOOT)
    assert kinds(found) == [Header, Message, Footer]
    assert damage == lost(f"a chunk is damaged ({why}) and left out", left_out=1)


@pytest.mark.parametrize("crc", [0, None])
@pytest.mark.parametrize(
    ("inner", "kept"),
    [
        (message(3)[:5], 0),
        (record(MESSAGE, b"short"), 0),
        (message(1) + bytes(9) + message(3), 2),
        (message(1) + struct.pack("<BQ", MESSAGE, 1000) + message(3), 1),
        (message(1) + message(3)[:-1], 1),
    ],
)
def test_a_chunk_that_is_damaged_inside_is_read_as_far_as_it_goes(
    inner: bytes, kept: int, crc: int | None, tmp_path: Path
) -> None:
    """Only the rest was missing, without a word: half of a flight."""
    found, damage = read(tmp_path, MAGIC + HEAD + chunk(inner, crc=crc) + message(2) + FOOT)
    assert kinds(found) == [Header, *[Message] * (kept + 1), Footer]
    (note,) = damage.notes
    assert note == "a.mcap: a chunk is damaged inside, and read up to 2.5 s before its end"
    assert damage.left_out == 1
    assert damage.lost_s == pytest.approx(2.5, abs=1e-6)


def test_zeros_between_records_are_told_once(tmp_path: Path) -> None:
    found, damage = read(tmp_path, MAGIC + HEAD + bytes(90) + message(2) + FOOT)
    assert kinds(found) == [Header, Message, Footer]
    assert damage.notes == [f"a.mcap: zeros instead of records, at byte {len(MAGIC + HEAD)}; left out"]


def test_a_chunk_without_a_checksum_is_accepted(tmp_path: Path) -> None:
    found, damage = read(tmp_path, MAGIC + chunk(message(1), crc=0) + FOOT)
    assert kinds(found) == [Message, Footer]
    assert damage == Damage()


@pytest.mark.parametrize("kind", ["lz4", "zstd"])
def test_a_chunk_that_claims_little_and_holds_much_is_not_unpacked_whole(kind: str, tmp_path: Path) -> None:
    found, damage = read(tmp_path, MAGIC + chunk(bytes(10**7), kind, claims=10) + FOOT)
    assert kinds(found) == [Footer]
    assert damage.left_out == 1


def test_a_broken_record_costs_itself(tmp_path: Path) -> None:
    schema = record(SCHEMA, b"\1")
    found, damage = read(tmp_path, MAGIC + HEAD + schema + TYPE + FOOT)
    assert kinds(found) == [Header, Schema, Footer]
    at = len(MAGIC + HEAD)
    (note,) = damage.notes
    assert note.startswith("a.mcap: a record is damaged (")
    assert note.endswith(f"), at byte {at}; left out")
    assert (damage.lost_s, damage.left_out, damage.unfinished) == (0.0, 1, False)


@pytest.mark.parametrize("excess", [0, 1])
def test_a_record_beyond_all_measure_is_passed_over(excess: int, tmp_path: Path) -> None:
    file, damage = tmp_path / "a.mcap", Damage()
    with file.open("wb") as stream:  # sparse: it takes no room
        stream.write(MAGIC + struct.pack("<BQ", STATISTICS, MOST_B + excess))
        stream.seek(MOST_B + excess, 1)
        stream.write(FOOT)
    assert kinds(list(records(file, damage))) == [Footer]
    note = f"a.mcap: a record of {MOST_B + 1} bytes, at byte {len(MAGIC)}, wanted at most {MOST_B}; left out"
    assert damage == Damage([note] * excess, 0.0, False, excess)


@pytest.mark.parametrize("chunks", [True, False])
def test_the_time_of_a_chunk_that_is_cut_off_is_lost(chunks: bool, tmp_path: Path) -> None:
    whole, at = chunk(message(1)), len(MAGIC + HEAD)
    for kept in (len(whole) - 1, 9 + 16):
        found, damage = read(tmp_path, MAGIC + HEAD + whole[:kept], chunks=chunks)
        assert kinds(found) == [Header]
        note = f"the file ends in the middle of a chunk, at byte {at}"
        assert damage == lost(note, left_out=0, unfinished=True)


def test_what_is_cut_off_before_its_time_is_only_given(tmp_path: Path) -> None:
    at = len(MAGIC + HEAD)
    for cut in (chunk(message(1))[: 9 + 15], message(1)[:-1], message(1)[:3], b"\x05"):
        found, damage = read(tmp_path, MAGIC + HEAD + cut)
        assert kinds(found) == [Header]
        note = f"the file ends in the middle of a record, at byte {at}"
        assert damage == lost(note, left_out=0, seconds=0.0, unfinished=True)


def test_times_that_run_backward_lose_no_time() -> None:
    damage = Damage()
    damage.skip("a", 5, 2)
    damage.add_loss("b", 0, 1_500_000_000)
    assert damage == Damage(["a", "b"], 1.5, False, 1)
