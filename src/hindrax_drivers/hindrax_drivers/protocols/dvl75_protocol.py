"""Sentences of a Cerulean DVL-75 and Tracker 650. Pure functions on verified fields.

Sources: docs.ceruleansonar.com, "DVL-75 / Communicating with the DVL" and "Tracker 650 / Communicating with the
Tracker 650", with the sentence's own page named at each function; field counts as in captured lines, which end $DVEXT
with an empty field that the page does not show.
"""

from __future__ import annotations

import math
from typing import TypeAlias

from hindrax_core.readings import Beam, BottomTrack, KalmanSupport, Position, Vec3
from hindrax_drivers.protocols.nmea import SentenceError, integer, number, numbers

Delta: TypeAlias = tuple[int, int, Vec3, int]
"""Device time [us], interval [us], change of position in it [m], confidence [%]."""

CLOCK_END_US = 1 << 63
FARTHEST_m = 1000.0
POSITION_STEP_m = 0.001
"""Position deltas are printed with three decimals."""


def position_delta(fields: list[bytes]) -> Delta:
    """Fields of a $DVPDL, or of a $DVPDX without its last four. Page "$DVPDL and $DVPDX"."""
    if len(fields) != 10:
        raise SentenceError("fields")
    _, tu, dtu, _, _, _, x, y, z, confidence = fields
    try:
        return int(tu), int(dtu), (float(x), float(y), float(z)), int(confidence)
    except ValueError:
        raise SentenceError("number") from None


def standoff(fields: list[bytes]) -> float:
    """Distance to the target plane along its normal [m], last field of a $DVPDX. Page "$DVPDL and $DVPDX"."""
    if len(fields) != 14:
        raise SentenceError("fields")
    return number(fields[13])


def extended(fields: list[bytes], attitude_sign: Vec3) -> BottomTrack:
    """Fields of a $DVEXT: 34 values, and an empty one where captured lines have it. Page "$DVEXT: DVL Extended Data".

    What the page calls optional, or another IMU fills otherwise, costs itself and not the altitude: calibration
    digits are kept as they come, a beam without a number has NaN.
    """
    if len(fields) < 35:
        raise SentenceError("fields")
    locked = _flag(fields[1])
    roll, pitch, heading, skipped, _, altitude, north, east = numbers(fields[4:12])
    if abs(roll) > 180.0 or abs(pitch) > 180.0 or not 0.0 <= heading <= 360.0 or not skipped.is_integer():
        raise SentenceError("range")
    if locked and not 0.0 < altitude < FARTHEST_m:
        raise SentenceError("range")
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
    """Place in the device's own $GPRMC: status, ddmm.mmmm and N or S, dddmm.mmmm and E or W. NMEA 0183, RMC."""
    if len(fields) < 7:
        raise SentenceError("fields")
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


def _flag(field: bytes) -> bool:
    if field not in (b"T", b"F"):
        raise SentenceError("flag")
    return field == b"T"


def kalman_support(fields: list[bytes]) -> KalmanSupport:
    """$DVKFA: version, sequence, interval, then the groups. Page "$DVKFA, $DVKFB Kalman Filter Support Messages".

    The page names the fields of the groups nowhere; they are handed on in their order.
    """
    if len(fields) < 4:
        raise SentenceError("fields")
    try:
        version = int(fields[1], 0)
    except ValueError:
        raise SentenceError("number") from None
    return KalmanSupport(version, integer(fields[2]), number(fields[3]), tuple(_with_gaps(fields[4:])))


def retweet(line: bytes) -> list[float]:
    """Eleven numbers of an `IMU:` line: quaternion, acceleration, rates, time. Page "Re-Tweeted IMU Messages"."""
    fields = line.removeprefix(b"IMU:").strip().split(b",")
    if len(fields) != 11:
        raise SentenceError("fields")
    return numbers(fields)


def configuration(fields: list[bytes]) -> dict[str, str]:
    """Settings of a $DVNVM as key and value. Page "$DVNVM Non-Volatile Memory and Configuration"."""
    pairs = (field.decode("ascii", "replace").partition("=") for field in fields[1:] if field)
    return {key.strip(): value.strip() for key, _, value in pairs}
