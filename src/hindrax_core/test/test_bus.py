"""The runner and the rehearsal of bus programs."""

from typing import TypeAlias

import pytest

from hindrax_core.bus_operations import (
    DeviceError,
    Pause,
    Program,
    Read,
    Transaction,
    Write,
    WriteRead,
    pack_transaction,
    run,
    unpack_transaction,
)
from hindrax_core.testing import chunks, rehearse


def double_register() -> Program[int]:
    yield Write(0x10, b"\x01")
    yield Pause(0.5)
    answer = yield WriteRead(0x10, b"\x02", 1)
    return answer[0] * 2


def patient() -> Program[str]:
    try:
        yield Read(0x10, 1)
    except DeviceError:
        yield Pause(1.0)
    return "went on"


def test_run_passes_answers_and_pauses() -> None:
    seen: list[Transaction | float] = []

    def transfer(transaction: Transaction) -> bytes:
        seen.append(transaction)
        return b"\x15" if isinstance(transaction, WriteRead) else b""

    assert run(double_register(), transfer, seen.append) == 0x2A
    assert seen == [Write(0x10, b"\x01"), 0.5, WriteRead(0x10, b"\x02", 1)]


def test_run_throws_a_bad_wire_into_the_program() -> None:
    def transfer(_: Transaction) -> bytes:
        raise DeviceError("no acknowledge")

    assert run(patient(), transfer, lambda _: None) == "went on"
    with pytest.raises(DeviceError, match="no acknowledge"):
        run(double_register(), transfer, lambda _: None)


def test_run_refuses_an_answer_of_the_wrong_length() -> None:
    with pytest.raises(DeviceError, match="short read, found 0 bytes, wanted 1"):
        run(double_register(), lambda _: b"", lambda _: None)


def test_the_tap_receives_what_succeeded() -> None:
    tapped: list[tuple[Transaction, bytes]] = []

    def transfer(transaction: Transaction) -> bytes:
        if isinstance(transaction, Read):
            raise DeviceError("no acknowledge")
        return b"\x15" if isinstance(transaction, WriteRead) else b""

    run(patient(), transfer, lambda _: None, lambda *one: tapped.append(one))
    run(double_register(), transfer, lambda _: None, lambda *one: tapped.append(one))
    assert tapped == [(Write(0x10, b"\x01"), b""), (WriteRead(0x10, b"\x02", 1), b"\x15")]


Transcript: TypeAlias = list[tuple[Transaction | Pause, bytes]]
TRANSCRIPT: Transcript = [
    (Write(0x10, b"\x01"), b""),
    (Pause(0.5), b""),
    (WriteRead(0x10, b"\x02", 1), b"\x15"),
]


def test_rehearsal_returns_the_result() -> None:
    assert rehearse(double_register(), TRANSCRIPT) == 0x2A
    assert rehearse(patient(), [(Read(0x10, 1), DeviceError("nack")), (Pause(1.0), b"")]) == "went on"


@pytest.mark.parametrize(
    "transcript",
    [TRANSCRIPT[:-1], [*TRANSCRIPT, (Pause(1.0), b"")], [(Write(0x10, b"\x09"), b""), *TRANSCRIPT[1:]]],
    ids=["line unsaid in the transcript", "line unsaid by the program", "another line"],
)
def test_rehearsal_fails_on_any_difference(transcript: Transcript) -> None:
    with pytest.raises(AssertionError):
        rehearse(double_register(), transcript)


@pytest.mark.parametrize("transaction", [Write(0x40, b"\x00\x10"), Read(0x76, 3), WriteRead(0x68, b"\x72", 512)])
def test_transactions_survive_being_written_down(transaction: Write | Read | WriteRead) -> None:
    assert unpack_transaction(pack_transaction(transaction)) == transaction


def test_a_cut_transaction_is_refused() -> None:
    with pytest.raises(ValueError, match="found a transaction of 2 bytes"):
        unpack_transaction(b"\x40\x00")


def test_chunks_are_the_whole() -> None:
    data = bytes(range(100))
    assert b"".join(chunks(data, [1, 7, 0, 3])) == data
    assert [len(piece) for piece in chunks(b"abcdef", [2, 3])] == [2, 3, 1]
