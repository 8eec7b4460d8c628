"""NMEA-like sentences: lines out of a byte stream, the checksum, the fields.

The rule is that of NMEA 0183: `$`, fields between commas, `*`, and the XOR of all bytes between `$` and `*` as two
hexadecimal digits. Line ends may be LF or CR LF.
"""

from __future__ import annotations

MAX_LINE = 1024
"""Bytes after which a line is no line. The longest known sentence, a $DVNVM with all its keys, has about 500."""

_DIGITS = {form % value: value for value in range(256) for form in (b"*%02X", b"*%02x")}
_NUMERIC = b"0123456789.,-+"


class SentenceError(ValueError):
    """A sentence that is refused; the text is the reason, out of a small set, so that refusals can be counted."""


class LineSplitter:
    """Cuts a byte stream into candidate lines, independent of its chunking.

    A piece ends at a line end, before a `$` (a sentence cannot hold one, so a new one has begun and the old one was
    cut or lost its line end), or when it has grown to MAX_LINE bytes; then it is garbage, and what follows is not.
    """

    def __init__(self) -> None:
        self._rest = b""

    def clear(self) -> None:
        """Forget the unfinished line, as after a reconnection."""
        self._rest = b""

    def feed(self, data: bytes) -> list[bytes]:
        """Pieces that these bytes have completed, without line ends; none is empty."""
        *lines, rest = (self._rest + data).split(b"\n")
        pieces = []
        for line in lines:
            if line.rfind(b"$") <= 0 and len(line) < MAX_LINE:
                piece = line.rstrip(b"\r")
                if piece:
                    pieces.append(piece)
            else:
                pieces += _cut(line)
        if len(rest) >= MAX_LINE:
            rest = _cut_front(rest, pieces)
        self._rest = rest
        return pieces


def _cut_front(line: bytes, pieces: list[bytes]) -> bytes:
    """Move the complete part of a line without an end to the pieces; return the rest."""
    while len(line) >= MAX_LINE:
        cut = line.find(b"$", 1, MAX_LINE)
        cut = cut if cut > 0 else MAX_LINE
        piece = line[:cut].rstrip(b"\r")
        if piece:
            pieces.append(piece)
        line = line[cut:]
    return line


def _cut(line: bytes) -> list[bytes]:
    pieces: list[bytes] = []
    head, *others = _cut_front(line, pieces).split(b"$")
    parts = (head, *(b"$" + other for other in others))
    return pieces + [piece for part in parts if (piece := part.rstrip(b"\r"))]


def checksum(body: bytes) -> int:
    """XOR of all bytes (at most MAX_LINE): the whole as one integer, folded onto its lower half until a byte is left.

    Half the time of a loop over the bytes in C, a twentieth of one in Python.
    """
    n = int.from_bytes(body, "big")
    if n >> 1024:
        n ^= n >> 4096
        n ^= n >> 2048
        n ^= n >> 1024
    n ^= n >> 512
    n ^= n >> 256
    n ^= n >> 128
    n ^= n >> 64
    n ^= n >> 32
    n ^= n >> 16
    return (n ^ n >> 8) & 0xFF


def split_verified(line: bytes) -> list[bytes]:
    """Fields of `$TAG,...*hh`, the tag (without `$`) first; SentenceError unless the checksum is there and holds."""
    body = line[1:-3]
    if checksum(body) != _DIGITS.get(line[-3:]):
        raise SentenceError("checksum" if line[-3:] in _DIGITS else "no checksum")
    return body.split(b",")


def require_numbers(body: bytes) -> None:
    """SentenceError unless only digits, signs, points and commas are there.

    float() alone would also take `nan`, `1e9`, `1_0` and blanks.
    """
    if body.translate(None, _NUMERIC):
        raise SentenceError("number")


def number(field: bytes) -> float:
    """Finite number of a field in plain notation."""
    return numbers([field])[0]


def numbers(fields: list[bytes]) -> list[float]:
    """Finite numbers of fields in plain notation."""
    require_numbers(b"".join(fields))
    try:
        return list(map(float, fields))
    except ValueError:
        raise SentenceError("number") from None


def integer(field: bytes) -> int:
    """Whole number of a field in plain notation."""
    require_numbers(field)
    try:
        return int(field)
    except ValueError:
        raise SentenceError("number") from None
