"""Checkers shipped with the interfaces: transcripts for bus programs, chunking for decoders."""

import os
from collections.abc import Iterator, Sequence
from typing import Any, TypeVar

from hindrax_core.bus_operations import DeviceError, Operation, Program

ResultT = TypeVar("ResultT")
THOROUGH = os.environ.get("HINDRAX_THOROUGH", "") not in ("", "0")
"""Whether tests take hours and other draws (`HINDRAX_THOROUGH=1`), not the same ones in minutes."""


def rehearse(program: Program[ResultT], transcript: Sequence[tuple[Operation, bytes | DeviceError]]) -> ResultT:
    """Run a bus program against a transcript; it must use every line, in order.

    Parameters
    ----------
    program
        Generator of bus operations, as a driver yields them.
    transcript
        Lines of an operation that the program must yield, and the answer it gets: bytes, or an error thrown into it.

    Returns
    -------
    ResultT
        Of the program.

    Raises
    ------
    AssertionError
        Names the line where the program does something else, or that it never came to.
    """
    lines = iter(enumerate(transcript))
    answer: Any = None
    try:
        while True:
            operation = program.throw(answer) if isinstance(answer, DeviceError) else program.send(answer)
            number, (expected, answer) = next(lines, (-1, (None, b"")))
            if operation != expected:
                raise AssertionError(f"line {number}: program did {operation}, transcript says {expected}")
    except StopIteration as stop:
        unsaid = next(lines, None)
        if unsaid is not None:
            raise AssertionError(f"program ended before line {unsaid[0]}: {unsaid[1][0]}") from stop
        result: ResultT = stop.value
        return result


def chunks(data: bytes, sizes: Sequence[int]) -> Iterator[bytes]:
    """Cut data into pieces of the given sizes, repeated as often as needed; a size below one counts as one."""
    start, turn = 0, 0
    while start < len(data):
        size = max(1, sizes[turn % len(sizes)]) if sizes else len(data)
        yield data[start : start + size]
        start, turn = start + size, turn + 1


def load_profile() -> None:
    """Judge properties by what they find, never by the clock: a busy machine is slow, not wrong.

    The usual run tries the same examples every time, so that it tells of the change at hand; a thorough one looks for
    new ones.
    """
    from hypothesis import settings  # noqa: PLC0415  # only tests have it

    settings.register_profile("hindrax", deadline=None, derandomize=not THOROUGH)
    settings.load_profile("hindrax")
