"""Sentences of a Cerulean DVL-75 and Tracker 650. Pure functions on verified fields.

Sources: docs.ceruleansonar.com, "DVL-75 / Communicating with the DVL" and "Tracker 650 / Communicating with the
Tracker 650", with the sentence's own page named at each function; field counts as in captured lines, which end $DVEXT
with an empty field that the page does not show.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TypeAlias

from hindrax_core.readings import Beam, BottomTrack, Vec3
from hindrax_drivers.protocols.nmea import SentenceError, integer, number, numbers

Delta: TypeAlias = tuple[int, int, Vec3, int]
"""Device time [us], interval [us], change of position in it [m], confidence [%]."""

CLOCK_END_US = 1 << 63
FARTHEST_m = 1000.0
POSITION_STEP_m = 0.001
"""Position deltas are printed with three decimals."""


@dataclass(frozen=True, slots=True)
class KalmanHeader:
    """The part of $DVKFA that the page defines; the data groups after it are ignored."""

    version: int
    sequence: int
    interval_s: float


def position_delta(fields: list[bytes]) -> Delta:
    """Fields of a $DVPDL, or of a $DVPDX without its last four. Page "$DVPDL and $DVPDX"."""
    try:
        _, tu, dtu, _, _, _, x, y, z, confidence = fields
    except ValueError:
        raise SentenceError("fields") from None
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
    """Fields of a $DVEXT: 34 values and an empty one. Page "$DVEXT: DVL Extended Data"."""
    if len(fields) != 36 or fields[35] or not fields[3].isdigit() or len(fields[3]) != 4:
        raise SentenceError("fields")
    locked = _flag(fields[1])
    # Check all numbers at once: roll to quaternion and gains, then velocities and ranges of the beams.
    values = numbers(fields[4:23] + fields[27:35])
    roll, pitch, heading, skipped, _, altitude, north, east = values[:8]
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
        beams=_beams(fields[23:27], values[15:]),
        imu_calibration=fields[3].decode("ascii"),
        skipped_pings=int(skipped),
    )


def _beams(locks: list[bytes], values: list[float]) -> tuple[Beam, ...]:
    """Beams A to D from their locks and 4 gains, 4 velocities, 4 ranges; a range of -1 means that there is none."""
    rows = zip(locks, values[4:8], values[8:], values[:4], strict=True)
    return tuple([Beam(_flag(lock), speed, reach if reach >= 0.0 else None, gain) for lock, speed, reach, gain in rows])


def _flag(field: bytes) -> bool:
    if field not in (b"T", b"F"):
        raise SentenceError("flag")
    return field == b"T"


def kalman_header(fields: list[bytes]) -> KalmanHeader:
    """Version, sequence and interval of a $DVKFA. Page "$DVKFA, $DVKFB Kalman Filter Support Messages"."""
    if len(fields) < 4:
        raise SentenceError("fields")
    try:
        version = int(fields[1], 0)
    except ValueError:
        raise SentenceError("number") from None
    return KalmanHeader(version, integer(fields[2]), number(fields[3]))


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
