"""Four hundred thousand frames for a stream decoder: out of a pool of good ones, half of them damaged, in many ways."""

from collections.abc import Callable, Iterator, Sequence
from random import Random

from hindrax_core.testing import chunks

FRAMES = 400_000
BATCH = 1000
POOL = 5000
LONGEST_CHUNK = 4000


def flood(
    frame: Callable[[Random], bytes], marks: Sequence[bytes], dice: Random, batch: int = BATCH
) -> Iterator[bytes]:
    """Batches of frames; `marks` are bytes that mean something to the decoder."""
    pool = [frame(dice) for _ in range(POOL)]
    for _ in range(FRAMES // batch):
        yield b"".join([mutate(one, marks, dice) for one in dice.choices(pool, k=batch)])


def mutate(frame: bytes, marks: Sequence[bytes], dice: Random) -> bytes:
    """As it was, or damaged in one of the ways."""
    way = int(dice.random() * 2 * len(WAYS))
    return WAYS[way](frame, int(dice.random() * len(frame)), marks, dice) if way < len(WAYS) else frame


WAYS: tuple[Callable[[bytes, int, Sequence[bytes], Random], bytes], ...] = (
    lambda frame, at, _marks, _dice: frame[:at],
    lambda frame, at, _marks, _dice: frame[at:],
    lambda frame, at, _marks, _dice: frame[:at] + frame,
    lambda frame, at, _marks, dice: frame[:at] + bytes((frame[at] ^ 1 << int(dice.random() * 8),)) + frame[at + 1 :],
    lambda frame, at, marks, dice: frame[:at] + dice.choice(marks) + frame[at + int(dice.random() * 2) :],
    lambda frame, at, _marks, dice: frame[:at] + dice.randbytes(1 + int(dice.random() * 30)) + frame[at:],
    lambda _frame, _at, _marks, dice: dice.randbytes(int(dice.random() * 100)),
)
"""Cut behind, cut before, doubled, a flipped bit, a false mark, torn apart by noise, noise altogether."""


def chunked(data: bytes, dice: Random) -> Iterator[bytes]:
    """Cut a batch as a port might, from single bytes on."""
    return chunks(data, [1, 2, 3, *(1 + int(dice.random() * LONGEST_CHUNK) for _ in range(5))])
