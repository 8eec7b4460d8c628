"""Logs of ArduPilot as tables: DataFlash .bin and telemetry .tlog, read by pymavlink, and recordings of BlueOS.

Messages of the log (XKF1, NKF1, ATT, IMU, RCOU, BAT, BARO) and of MAVLink (LOCAL_POSITION_NED, ATTITUDE,
SERVO_OUTPUT_RAW, SYS_STATUS, SCALED_PRESSURE). What the estimator says of itself counts: a velocity is data while the
filter claims it, not while it holds a constant position (XKF4.SS and EKF_STATUS_REPORT.flags, nav_filter_status and
EKF_STATUS_FLAGS of the public documentation, whose bits 0 to 9 agree).

Time. A DataFlash log has the time since power-up in every message. Telemetry is stamped when it is received, which may
be late by half a second and wanders; the messages' own times since power-up are used, and messages without one are
placed by the shortest delay between the two clocks that was seen so far.
"""

import functools
import io
import math
import os
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, Protocol, TypeAlias

import numpy as np

from hindrax_analysis.records import blueos_recording
from hindrax_bag.read.mcap_records import Damage
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.screen_text import how_to_install
from hindrax_ident.arrays import Array, array

Quantity: TypeAlias = Literal["velocity", "attitude", "rate", "pulses", "supply", "pressure", "status"]
Tables: TypeAlias = dict[Quantity, tuple[Array, Array]]
"""Quantity -> times (n,) [s] and rows (n, k): m/s in north, east, down; roll, pitch, yaw [rad]; rad/s; us; V; Pa."""

CHANNELS = 14
DEGREE = math.pi / 180.0
FIELDS: dict[str, tuple[tuple[Quantity, float, tuple[str, ...]], ...]] = {
    "XKF1": (("velocity", 1.0, ("VN", "VE", "VD")),),
    "NKF1": (("velocity", 1.0, ("VN", "VE", "VD")),),
    "XKF4": (("status", 1.0, ("SS",)),),
    "NKF4": (("status", 1.0, ("SS",)),),
    "ATT": (("attitude", DEGREE, ("Roll", "Pitch", "Yaw")),),
    "IMU": (("rate", 1.0, ("GyrX", "GyrY", "GyrZ")),),
    "RCOU": (("pulses", 1.0, tuple(f"C{n}" for n in range(1, CHANNELS + 1))),),
    "BAT": (("supply", 1.0, ("Volt",)),),
    "BARO": (("pressure", 1.0, ("Press",)),),
    "LOCAL_POSITION_NED": (("velocity", 1.0, ("vx", "vy", "vz")),),
    "EKF_STATUS_REPORT": (("status", 1.0, ("flags",)),),
    "ATTITUDE": (("attitude", 1.0, ("roll", "pitch", "yaw")), ("rate", 1.0, ("rollspeed", "pitchspeed", "yawspeed"))),
    "SERVO_OUTPUT_RAW": (("pulses", 1.0, tuple(f"servo{n}_raw" for n in range(1, CHANNELS + 1))),),
    "SYS_STATUS": (("supply", 1e-3, ("voltage_battery",)),),
    "SCALED_PRESSURE": (("pressure", 100.0, ("press_abs",)),),
    "SCALED_PRESSURE2": (("pressure", 100.0, ("press_abs",)),),
}
"""Message -> quantities, their factor to SI, and their fields."""
PARAMETERS = ("PARM", "PARAM_VALUE")
KINDS = [*FIELDS, *PARAMETERS]
"""Messages that are read."""
RECEIVED = (".tlog", blueos_recording.ENDING)
"""Logs of what another computer received, stamped by its clock."""
INSTANCES = ("C", "I", "Inst", "Instance", "port")
"""Fields that number the sensors, estimators or ports of a kind; the first of each is used."""
HORIZONTAL, VERTICAL, CONSTANT_POSITION = (
    blueos_recording.FLAGS[name] for name in ("EKF_VELOCITY_HORIZ", "EKF_VELOCITY_VERT", "EKF_CONST_POS_MODE")
)
"""Bits of the estimator's status: what it claims, and that it has no aiding."""
WRAP_S = 2.0**32 * 1e-6
"""The time of the outputs, in microseconds of 32 bits, begins again after 71.6 minutes."""
MOST_ROWS = 2_000_000
MOST_DAMAGED = 0.001
"""Places that are no message, of all messages, from which on the others are not believed either. A cut has one."""
INDEX_REST_B = 528
"""What may be left behind the index of a .bin: the rest of a page of a block-based log, and garbage (pymavlink)."""
SKIPPED = re.compile(r"Skipped \d+ bad bytes in log at offset (\d+)")
"""What pymavlink prints of a place of a .bin that is no message."""
RESTART_S = 5.0
"""A time since power-up that steps back by more than this is that of another start."""


@dataclass(slots=True)
class ArduPilotLog:
    """One start of an autopilot: tables of its quantities, and its parameters.

    `others`: numbers of the MAVLink systems whose messages were left out, being of other vehicles. `damaged`: places
    of the file that are no message, its end not counted.
    """

    tables: Tables = field(default_factory=dict)
    parameters: Mapping[str, float] = field(default_factory=dict)
    others: tuple[int, ...] = ()
    damaged: int = 0


def read_starts(path: Path) -> list[ArduPilotLog]:
    """Tables of each start of the autopilot in a log.

    A log is asked twice, for its wiring and for its record, and read once: pymavlink takes minutes for a long dive.

    Parameters
    ----------
    path
        A .bin or .tlog file, or a recording of BlueOS. UsageError for what is no such log.

    Returns
    -------
    list[ArduPilotLog]
        In time order.
    """
    status = path.stat()
    return _read_starts(path, status.st_size, status.st_mtime_ns)


@functools.lru_cache(maxsize=2)
def _read_starts(path: Path, _size: int, _changed_ns: int) -> list[ArduPilotLog]:
    with _complaints() as complaints:
        starts, messages, strange = _starts(path)
    # Its index and its reader may both name a place.
    places = len(set(SKIPPED.findall("".join(complaints)))) + strange
    again = "copy it again" if path.suffix.lower() in RECEIVED else "download it from the autopilot again"
    if places > 1 and not messages:
        raise UsageError(
            f"{path}: found no message that is whole, in {places} places: the beginning of a log, which defines its "
            f"messages, is missing or damaged; {again}"
        )
    if places > max(1.0, MOST_DAMAGED * messages):
        raise UsageError(
            f"{path}: is damaged in {places} places, with {messages} messages whose values are in doubt as well; "
            f"{again}"
        )
    return [replace(one, damaged=places) for one in starts]


@contextmanager
def _complaints() -> Iterator[list[str]]:
    """Keep from the terminal what pymavlink prints, a line for each place that it skips; the list has it at the end.

    Its compiled part writes to the descriptor, the other one to `sys.stderr`.
    """
    said = io.StringIO()
    found: list[str] = []
    own = os.dup(2)
    try:
        with tempfile.TemporaryFile("w+") as compiled:
            os.dup2(compiled.fileno(), 2)
            try:
                with redirect_stdout(said), redirect_stderr(said):
                    yield found
            finally:
                os.dup2(own, 2)
                compiled.seek(0)
                found += [said.getvalue(), compiled.read()]
    finally:
        os.close(own)


class _Message(Protocol):
    def get_type(self) -> str:
        """Name of its kind."""


def _starts(path: Path) -> tuple[list[ArduPilotLog], int, int]:
    """Starts, how many messages were read, and how many of them are not as their kind is: its definition is damaged."""
    ending, damage = path.suffix.lower(), Damage()
    clock = _Clock() if ending in RECEIVED else None
    starts: list[_Rows] = []
    messages, strange, others = 0, 0, set[int]()
    read = _of_blueos(path, damage) if ending == blueos_recording.ENDING else _messages(path)
    found = read if clock is None else _of_one_vehicle(read, others)
    stamped = (
        # Of a damaged file, a message before the first with a time has none.
        (message, float(getattr(message, "_timestamp", math.nan)) if clock is None else clock.read(message))
        for message in found
    )
    for message, at_s in _in_order(stamped):
        messages += 1
        try:
            _take(path, message, at_s, starts)
        except (AttributeError, TypeError, ValueError):
            strange += 1
    left_out, strange = tuple(sorted(others)), strange + damage.left_out
    kept = [one for one in starts if one.found] or [one for one in starts if one.parameters]
    return [ArduPilotLog(one.tables(), one.parameters, left_out) for one in kept], messages, strange


def _take(path: Path, message: _Message, at_s: float, starts: "list[_Rows]") -> None:
    """Add a message to the start that it belongs to; AttributeError, TypeError, ValueError where it lacks a field."""
    kind = message.get_type()
    if kind in PARAMETERS:
        if math.isfinite(value := _value(message)):  # one that was never set, or a flipped bit
            _rows_of(starts).parameters[_name(message)] = value
        return
    if math.isnan(at_s):
        return
    if starts and at_s < starts[-1].newest_s - RESTART_S:
        starts.append(_Rows(dict(starts[-1].parameters)))
    _rows_of(starts).add(path, kind, message, at_s)


def _of_one_vehicle(messages: Iterator[Any], others: set[int]) -> Iterator[Any]:
    """Messages of the system that sends the first one; `others` gets the numbers of all that are left out.

    A ground station records every vehicle of its network into one file.
    """
    own = None
    for message in messages:
        system = message.get_srcSystem()
        own = system if own is None else own
        if system == own:
            yield message
        else:
            others.add(system)


def _in_order(stamped: Iterator[tuple[Any, float]]) -> Iterator[tuple[Any, float]]:
    """Messages with their times [s], without those whose time steps away while the next one goes on as before it.

    That is a flipped bit. A start of the autopilot goes on from its own time.
    """
    before_s, held = math.nan, None
    for one in stamped:
        if held is not None:
            if abs(held[1] - before_s) > RESTART_S >= abs(one[1] - before_s):
                held = one
                continue
            yield held
            before_s = held[1]
        held = one
    if held is not None:
        yield held


def _rows_of(starts: "list[_Rows]") -> "_Rows":
    if not starts:
        starts.append(_Rows({}))
    return starts[-1]


def _name(message: Any) -> str:
    name = getattr(message, "Name", None) or message.param_id
    return str(name.decode() if isinstance(name, bytes) else name).rstrip("\0")


def _value(message: Any) -> float:
    return float(message.Value if hasattr(message, "Value") else message.param_value)


class _Rows:
    """Rows of one start while they are read; a time that does not grow within a kind of message is left out."""

    def __init__(self, parameters: dict[str, float]) -> None:
        self.parameters = parameters
        self.found: dict[tuple[Quantity, str], tuple[list[float], list[list[float]]]] = {}
        self.newest_s = -math.inf

    def add(self, path: Path, kind: str, message: object, at_s: float) -> None:
        """Take the quantities of one message."""
        instance = next((getattr(message, name) for name in INSTANCES if getattr(message, name, 0)), 0)
        self.newest_s = max(self.newest_s, at_s)
        for quantity, factor, fields in FIELDS[kind]:
            if instance and quantity != "pressure":  # of several barometers the one in the water is found later
                return
            # Outputs that a log does not have stand still; what else it lacks is not known.
            lacking = 0 if quantity == "pulses" else None
            found = [getattr(message, name, lacking) for name in fields]
            row = [factor * float(value) for value in found if value is not None]
            if len(row) < len(fields):
                continue
            times, rows = self.found.setdefault((quantity, f"{kind} {instance}"), ([], []))
            if not times or at_s > times[-1]:
                times.append(at_s)
                rows.append(row)
            if len(times) > MOST_ROWS:
                raise UsageError(f"{path}: found more than {MOST_ROWS} of {kind}; cut the log first")

    def tables(self) -> Tables:
        """Tables by quantity: of several sources the first; of several pressures that which varies most."""
        out: Tables = {}
        for (quantity, _), (times, rows) in self.found.items():
            table = array(np.array(times)), array(np.array(rows))
            if quantity == "pressure" and quantity in out and np.ptp(out[quantity][1]) >= np.ptp(table[1]):
                continue
            if quantity == "pressure" or quantity not in out:
                out[quantity] = table
        return out


class _Clock:
    """Time since power-up of messages with one, and of those without [s]."""

    def __init__(self) -> None:
        self._delay_s = math.inf
        self._wraps, self._last_s = 0, -math.inf

    def read(self, message: Any) -> float:
        """Time of one message; NaN before the first that has its own: nothing is known of the delay."""
        received_s = float(message._timestamp)  # noqa: SLF001  # pymavlink's own name of it
        if (boot_ms := getattr(message, "time_boot_ms", None)) is not None:
            return self._seen(1e-3 * boot_ms, received_s)
        if (usec := getattr(message, "time_usec", None)) is not None:
            at_s = 1e-6 * usec + self._wraps * WRAP_S
            if at_s < self._last_s - 0.5 * WRAP_S:
                self._wraps, at_s = self._wraps + 1, at_s + WRAP_S
            self._last_s = at_s
            return self._seen(at_s, received_s)
        return received_s - self._delay_s if math.isfinite(self._delay_s) else math.nan

    def _seen(self, at_s: float, received_s: float) -> float:
        delay_s = received_s - at_s
        # After a restart the clocks are apart by more than any delay.
        self._delay_s = delay_s if delay_s > self._delay_s + RESTART_S else min(self._delay_s, delay_s)
        return at_s


def claimed(tables: Tables) -> tuple[Array, Array] | None:
    """Velocities of a log, where its estimator claims them.

    Parameters
    ----------
    tables
        By the name of the message. A log without the estimator's status is believed.

    Returns
    -------
    tuple[Array, Array] | None
        Times (n,) [s] and velocities (n, 3) [m/s], NaN where they are not claimed; None without velocities.
    """
    if "velocity" not in tables:
        return None
    t, rows = tables["velocity"]
    rows = rows.copy()
    if "status" in tables:
        status_t, status = tables["status"]
        at = np.clip(np.searchsorted(status_t, t, side="right") - 1, 0, None)
        flags = status[at, 0].astype(int)
        horizontal = ((flags & HORIZONTAL) != 0) & ((flags & CONSTANT_POSITION) == 0)
        rows[~horizontal, :2] = np.nan
        rows[(flags & VERTICAL) == 0, 2] = np.nan
    return t, array(rows)


def _of_blueos(path: Path, damage: Damage) -> Iterator[blueos_recording.JsonMessage]:
    return (one for one in blueos_recording.read_messages(path, damage) if one.get_type() in KINDS)


def _messages(path: Path) -> Iterator[Any]:
    try:
        from pymavlink import mavutil  # noqa: PLC0415  # a vehicle does without it
    except ImportError as error:
        raise HindraxError(f"{path}: logs of ArduPilot need pymavlink; {how_to_install('autopilot')}") from error
    try:
        log = mavutil.mavlink_connection(str(path))
        through_index = KINDS if _index_is_whole(log) else None
        while (message := log.recv_match(type=through_index)) is not None:
            if through_index or message.get_type() in KINDS:
                yield message
    except Exception as error:  # pymavlink raises plain ones on garbage
        why = type(error).__name__
        raise UsageError(
            f"{path}: is no log of ArduPilot, or is cut off ({why} of pymavlink); copy it again"
        ) from error


class _Format(Protocol):
    len: int


class _Indexed(Protocol):
    """What is used of pymavlink's reader of a .bin."""

    offsets: Sequence[Sequence[int]]
    """Places of the messages, by kind."""
    formats: Mapping[int, _Format]
    data_len: int


def _index_is_whole(log: _Indexed) -> bool:
    """Whether pymavlink's index of a .bin reaches its end: it stops at the first kind of message that is not defined.

    A flipped bit in the head of one message is enough, and all behind it would be lost without a word. A file without
    an index (.tlog) is read from one message to the next.
    """
    if not hasattr(log, "formats"):
        return True
    of_kinds = [(kind, offsets) for kind, offsets in enumerate(log.offsets) if kind in log.formats and len(offsets)]
    end = max((offsets[-1] + log.formats[kind].len for kind, offsets in of_kinds), default=0)
    return bool(log.data_len - end < INDEX_REST_B)
