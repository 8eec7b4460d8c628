"""Sentences of a Cerulean DVL-75 and Tracker 650: lines out of a byte stream, the checksum, the fields, their meaning.

Sources: docs.ceruleansonar.com, "DVL-75 / Communicating with the DVL" and "Tracker 650 / Communicating with the
Tracker 650", with the sentence's own page named at each function; field counts as in captured lines, which end $DVEXT
with an empty field that the page does not show.

Lines follow NMEA 0183: `$`, fields between commas, `*`, and the XOR of all bytes between `$` and `*` as two hexadecimal
digits. Line ends may be LF or CR LF.
"""

import math
import re
from typing import TypeAlias

from hindrax_core.readings import Beam, BottomTrack, KalmanSupport, Position, Vec3
from hindrax_core.rejects import RejectCode

Delta: TypeAlias = tuple[int, int, Vec3, int]
"""Device time [us], interval [us], change of position in it [m], confidence [%]."""

CLOCK_END_US = 1 << 63
FARTHEST_m = 1000.0
POSITION_STEP_m = 0.001
"""Position deltas are printed with three decimals."""
MAX_LINE = 1024
"""Bytes after which a line is no line. The longest known sentence, a $DVNVM with all its keys, has about 500."""

_PIECE = re.compile(rb"(?s).[^$]{0,%d}" % (MAX_LINE - 1))
_DIGITS = {form % value: value for value in range(256) for form in (b"*%02X", b"*%02x")}
_NUMERIC = b"0123456789.,-+"


class SentenceError(ValueError):
    """A sentence that is refused, with its code."""

    def __init__(self, code: RejectCode) -> None:
        super().__init__(code.value)
        self.code = code


class LineSplitter:
    """Cuts a byte stream into candidate lines, independent of its chunking.

    A piece ends at a line end, before a `$` (a sentence cannot hold one, so a new one has begun and the old one was
    cut or lost its line end), or when it has grown to MAX_LINE bytes; then it is garbage, and what follows is not.
    """

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[bytes]:
        """Pieces that these bytes have completed, without line ends; none is empty."""
        *lines, rest = (self._rest + data).split(b"\n")
        pieces: list[bytes] = []
        for line in lines:
            whole = line.rfind(b"$") <= 0 and len(line) < MAX_LINE
            pieces += [line] if whole else _PIECE.findall(line)
        if len(rest) >= MAX_LINE:
            pieces += _PIECE.findall(rest)
            rest = b"" if len(pieces[-1]) == MAX_LINE else pieces.pop()
        self._rest = rest
        return [piece for line in pieces if (piece := line.rstrip(b"\r"))]


def checksum(body: bytes) -> int:
    """XOR of all bytes: the whole as one integer, folded onto its lower half until a byte is left.

    Half the time of a loop over the bytes in C, a twentieth of one in Python.

    Parameters
    ----------
    body
        At most MAX_LINE bytes.

    Returns
    -------
    int
        0 to 255.
    """
    n = int.from_bytes(body, "big")
    for half in (4096, 2048, 1024, 512, 256, 128, 64, 32, 16, 8):
        n ^= n >> half
    return n & 0xFF


def split_verified(line: bytes) -> list[bytes]:
    """Fields of `$TAG,...*hh`, the tag (without `$`) first; SentenceError unless the checksum is there and holds."""
    body = line[1:-3]
    if checksum(body) != _DIGITS.get(line[-3:]):
        raise SentenceError(RejectCode.CHECKSUM if line[-3:] in _DIGITS else RejectCode.NO_CHECKSUM)
    return body.split(b",")


def require_numbers(body: bytes) -> None:
    """Require plain notation: float() alone would also take `nan`, `1e9`, `1_0` and blanks.

    Parameters
    ----------
    body
        Fields with their commas.

    Raises
    ------
    SentenceError
        Unless only digits, signs, points and commas are there.
    """
    if body.translate(None, _NUMERIC):
        raise SentenceError(RejectCode.NUMBER)


def number(field: bytes) -> float:
    """Finite number of a field in plain notation."""
    return numbers([field])[0]


def numbers(fields: list[bytes]) -> list[float]:
    """Finite numbers of fields in plain notation; SentenceError for others."""
    require_numbers(b"".join(fields))
    try:
        return list(map(float, fields))
    except ValueError:
        raise SentenceError(RejectCode.NUMBER) from None


def integer(field: bytes) -> int:
    """Whole number of a field in plain notation; SentenceError for another."""
    require_numbers(field)
    try:
        return int(field)
    except ValueError:
        raise SentenceError(RejectCode.NUMBER) from None


def position_delta(fields: list[bytes]) -> Delta:
    """Fields of a $DVPDL, or of a $DVPDX without its last four; SentenceError. Page "$DVPDL and $DVPDX"."""
    if len(fields) != 10:
        raise SentenceError(RejectCode.FIELDS)
    _, tu, dtu, _, _, _, x, y, z, confidence = fields
    try:
        return int(tu), int(dtu), (float(x), float(y), float(z)), int(confidence)
    except ValueError:
        raise SentenceError(RejectCode.NUMBER) from None


def standoff(fields: list[bytes]) -> float:
    """Distance to the target plane [m], last field of a $DVPDX; SentenceError. Page "$DVPDL and $DVPDX"."""
    if len(fields) != 14:
        raise SentenceError(RejectCode.FIELDS)
    return number(fields[13])


def extended(fields: list[bytes], attitude_sign: Vec3) -> BottomTrack:
    """Read a $DVEXT. Page "$DVEXT: DVL Extended Data".

    What the page calls optional, or another IMU fills otherwise, costs itself and not the altitude: calibration digits
    are kept as they come, a beam without a number has NaN.

    Parameters
    ----------
    fields
        34 values, and an empty one where captured lines have it.
    attitude_sign
        Of roll, pitch and heading, to ours.

    Returns
    -------
    BottomTrack
        SI.

    Raises
    ------
    SentenceError
        For another number of fields, or what is no number.
    """
    if len(fields) < 35:
        raise SentenceError(RejectCode.FIELDS)
    if fields[1] not in (b"T", b"F"):
        raise SentenceError(RejectCode.FLAG)
    locked = fields[1] == b"T"
    roll, pitch, heading, skipped, _, altitude, north, east = numbers(fields[4:12])
    if abs(roll) > 180.0 or abs(pitch) > 180.0 or not 0.0 <= heading <= 360.0 or not skipped.is_integer():
        raise SentenceError(RejectCode.RANGE)
    if locked and not 0.0 < altitude < FARTHEST_m:
        raise SentenceError(RejectCode.RANGE)
    return BottomTrack(
        locked=locked,
        roll_rad=math.radians(roll * attitude_sign[0]),
        pitch_rad=math.radians(pitch * attitude_sign[1]),
        heading_rad=math.radians(heading * attitude_sign[2] % 360.0),
        altitude_m=altitude if locked else None,
        velocity_north_east_mps=(north, east),
        beams=_beams(fields[23:27], _with_gaps(fields[19:23] + fields[27:35])),
        imu_calibration=fields[3].decode("ascii", "replace"),
        skipped_pings=int(skipped),
    )


def _beams(locks: list[bytes], values: list[float]) -> tuple[Beam, ...]:
    """Beams A to D from their locks and 4 gains, 4 velocities, 4 ranges; a range of -1 means that there is none."""
    rows = zip(locks, values[4:8], values[8:], values[:4], strict=True)
    return tuple(
        [Beam(lock == b"T", speed, reach if reach >= 0.0 else None, gain) for lock, speed, reach, gain in rows]
    )


def _with_gaps(fields: list[bytes]) -> list[float]:
    """Numbers of fields, NaN where there is none."""
    try:
        return numbers(fields)
    except SentenceError:
        return [_number_or_nan(field) for field in fields]


def _number_or_nan(field: bytes) -> float:
    try:
        return number(field)
    except SentenceError:
        return math.nan


def position(fields: list[bytes]) -> Position | None:
    """Place in a $DVEXT; None where there is none. Page "$DVEXT": GPS `A` is fresh, latitude and longitude decimal."""
    return _place(_number_or_nan(fields[12]), _number_or_nan(fields[13]), fixed=fields[2] == b"A")


def recommended_minimum(fields: list[bytes]) -> Position | None:
    """Place in the device's own $GPRMC. NMEA 0183, RMC.

    Parameters
    ----------
    fields
        Status, ddmm.mmmm and N or S, dddmm.mmmm and E or W.

    Returns
    -------
    Position | None
        None without a place.

    Raises
    ------
    SentenceError
        For too few fields.
    """
    if len(fields) < 7:
        raise SentenceError(RejectCode.FIELDS)
    latitude, longitude = (_degrees(fields[at], fields[at + 1] in (b"S", b"W")) for at in (3, 5))
    return _place(latitude, longitude, fixed=fields[2] == b"A")


def _degrees(field: bytes, negative: bool) -> float:
    """Decimal degrees of degrees and minutes written together."""
    whole, minutes = divmod(_number_or_nan(field), 100.0)
    degrees = whole + minutes / 60.0
    return -degrees if negative else degrees


def _place(latitude_deg: float, longitude_deg: float, *, fixed: bool) -> Position | None:
    there = abs(latitude_deg) <= 90.0 and abs(longitude_deg) <= 180.0
    return Position(latitude_deg, longitude_deg, fixed) if there else None


def kalman_support(fields: list[bytes]) -> KalmanSupport:
    """Read a $DVKFA. Page "$DVKFA, $DVKFB Kalman Filter Support Messages".

    The page names the fields of the groups nowhere; they are handed on in their order.

    Parameters
    ----------
    fields
        Version, sequence, interval, then the groups.

    Returns
    -------
    KalmanSupport
        Numbers as the device has them.

    Raises
    ------
    SentenceError
        For too few fields, or what is no number.
    """
    if len(fields) < 4:
        raise SentenceError(RejectCode.FIELDS)
    try:
        version = int(fields[1], 0)
    except ValueError:
        raise SentenceError(RejectCode.NUMBER) from None
    return KalmanSupport(version, integer(fields[2]), number(fields[3]), tuple(_with_gaps(fields[4:])))


def retweet(line: bytes) -> list[float]:
    """Eleven numbers of an `IMU:` line; SentenceError. Page "Re-Tweeted IMU Messages".

    Parameters
    ----------
    line
        Quaternion, acceleration, rates, time.

    Returns
    -------
    list[float]
        In their order.

    Raises
    ------
    SentenceError
        For another number of them.
    """
    fields = line.removeprefix(b"IMU:").strip().split(b",")
    if len(fields) != 11:
        raise SentenceError(RejectCode.FIELDS)
    return numbers(fields)


def configuration(fields: list[bytes]) -> dict[str, str]:
    """Settings of a $DVNVM as key and value. Page "$DVNVM Non-Volatile Memory and Configuration"."""
    pairs = (field.decode("ascii", "replace").partition("=") for field in fields[1:] if field)
    return {key.strip(): value.strip() for key, _, value in pairs}
