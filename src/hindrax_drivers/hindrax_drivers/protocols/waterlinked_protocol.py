"""Reports and commands of a Water Linked DVL (A50, A125) over TCP: one JSON object a line.

Source: docs.waterlinked.com, "DVL A50/A125 TCP JSON API" (json_v3.1 and json_v3.2), whose sections are named at each
function; axes from its page "Axes": x forward, y starboard, z down, in the vehicle frame of the device.

JSON has no checksum; TCP has. What is damaged nevertheless, by a program in between or on a line in a test, is refused
by its shape: every field of a report has its type and its range, and what is said twice must agree.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass

from hindrax_core.readings import Beam, Vec3
from hindrax_core.rejects import RejectCode, reject

MAX_LINE = 8192
"""Bytes after which a line is no line; a velocity report with all digits has some 1200."""
LATEST_us = 5_000_000
"""Longest plausible time from the ping to the report; the example of the page has 0.19 s."""
FASTEST_mps, FARTHEST_m = 20.0, 300.0
LONGEST_ms = 600_000.0
SOUND_mps = (1000.0, 2000.0)
BEAMS = 4
WATER = ("water", "velocity_water")


class ReportError(ValueError):
    """A report that is refused, with its reason."""

    def __init__(self, code: RejectCode, kind: str, field: str = "") -> None:
        self.reason = reject(code, kind, field=field)
        super().__init__(self.reason)


class LineSplitter:
    """Cuts a byte stream into lines, whatever its chunks are. A line that has grown to MAX_LINE bytes is garbage."""

    def __init__(self) -> None:
        self._rest, self._too_long = b"", False

    def feed(self, data: bytes) -> list[bytes]:
        """Lines that these bytes have completed, without their ends; empty lines are none."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        if lines and self._too_long:
            # The end of what was too long is no report of its own.
            lines[0], self._too_long = b"\0", False
        if len(self._rest) > MAX_LINE:
            self._rest, self._too_long = b"", True
        return [line for one in lines if (line := one.rstrip(b"\r"))]


@dataclass(frozen=True, slots=True)
class VelocityReport:
    """Section "Velocity-and-transducer report". Velocity over ground in the device's vehicle frame.

    `interval_s` is the time since the report before; sigma that of surge and sway, by the covariance; times are those
    of the device's clock. `valid`: it has lock on the bottom, not on the water.
    """

    velocity_mps: Vec3
    sigma_mps: float
    fom_mps: float
    altitude_m: float
    beams: tuple[Beam, ...]
    valid: bool
    tracks_water: bool
    hot: bool
    interval_s: float
    validity_us: int
    transmission_us: int
    format: str


def parse(line: bytes) -> Mapping[str, object]:
    """Object of a line. ReportError for anything else."""
    try:
        found = json.loads(line, parse_constant=_refuse)
    except (ValueError, RecursionError) as error:
        raise ReportError(RejectCode.NOT_JSON, "line") from error
    if not isinstance(found, dict):
        raise ReportError(RejectCode.NOT_AN_OBJECT, "line")
    return found


def _refuse(name: str) -> float:
    """NaN and Infinity are no JSON, though Python reads them."""
    raise ValueError(name)


def velocity_report(report: Mapping[str, object]) -> VelocityReport:
    """Read a velocity report. ReportError names the field that is wrong."""
    form = text(report, "format")
    if not form.startswith("json_v3"):
        raise ReportError(RejectCode.FORMAT, "velocity")
    velocity = (_speed(report, "vx"), _speed(report, "vy"), _speed(report, "vz"))
    validity_us, transmission_us = (_whole(report, name) for name in ("time_of_validity", "time_of_transmission"))
    if not 0 <= transmission_us - validity_us <= LATEST_us:
        raise ReportError(RejectCode.TIMES, "velocity")
    water = report.get("tracking_mode") in WATER or report.get("type") in WATER
    return VelocityReport(
        velocity,
        _sigma(report.get("covariance")),
        _number(report, "fom", 0.0, FASTEST_mps),
        _number(report, "altitude", -1.0, FARTHEST_m),
        _beams(report.get("transducers")),
        valid=_flag(report, "velocity_valid") and not water,
        tracks_water=water,
        hot=bool(_whole(report, "status") & 1),
        interval_s=1e-3 * _number(report, "time", 0.0, LONGEST_ms),
        validity_us=validity_us,
        transmission_us=transmission_us,
        format=form,
    )


def _sigma(covariance: object) -> float:
    """Standard deviation of the worse of surge and sway [m/s]: the root of the larger diagonal element.

    The matrix is symmetric, so that each covariance is said twice; the figure of merit is the root of its largest
    eigenvalue (checked with the example of the page), which includes heave and is kept beside it.
    """
    if not isinstance(covariance, list):
        raise ReportError(RejectCode.FIELD, "velocity", "covariance")
    try:
        (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = covariance
        symmetric = all(math.isclose(a, b, rel_tol=1e-9) for a, b in ((xy, yx), (xz, zx), (yz, zy)))
        if not symmetric or min(xx, yy, zz) < 0.0 or not max(xx, yy, zz) < FASTEST_mps**2:
            raise ReportError(RejectCode.FIELD, "velocity", "covariance")
        return math.sqrt(max(xx, yy))
    except (TypeError, ValueError) as error:
        raise ReportError(RejectCode.FIELD, "velocity", "covariance") from error


def _beams(transducers: object) -> tuple[Beam, ...]:
    """Four beams in the order of their numbers; one without lock has no range."""
    if not isinstance(transducers, list) or len(transducers) != BEAMS:
        raise ReportError(RejectCode.FIELD, "velocity", "transducers")
    beams = []
    for number, one in enumerate(transducers):
        if not isinstance(one, dict) or one.get("id") != number:
            raise ReportError(RejectCode.FIELD, "velocity", "transducers")
        locked, range_m = _flag(one, "beam_valid"), _number(one, "distance", -1.0, 2.0 * FARTHEST_m)
        beams.append(
            Beam(locked, _speed(one, "velocity"), range_m if locked else None, _number(one, "rssi", -300, 300))
        )
    return tuple(beams)


@dataclass(frozen=True, slots=True)
class DeadReckoning:
    """Section "Dead reckoning report": its time [s], position from the start of the run [m], attitude [rad].

    Yaw counts from the start of the run: it is no heading.
    """

    time_s: float
    position_m: Vec3
    sigma_m: float
    attitude_rad: Vec3


def dead_reckoning(report: Mapping[str, object]) -> DeadReckoning:
    """Read a dead reckoning report. ReportError names the field that is wrong."""
    far = 1e6
    x, y, z = (_number(report, name, -far, far, "position") for name in ("x", "y", "z"))
    turns = (math.radians(_number(report, name, -360.0, 360.0, "position")) for name in ("roll", "pitch", "yaw"))
    roll, pitch, yaw = turns
    time_s = _number(report, "ts", 0.0, 1e12, "position")
    return DeadReckoning(time_s, (x, y, z), _number(report, "std", 0.0, far, "position"), (roll, pitch, yaw))


def settings(response: Mapping[str, object]) -> dict[str, object]:
    """Configuration in the answer to `get_config`; ReportError. Section "Fetching current configuration"."""
    found = response.get("result")
    if not isinstance(found, dict):
        raise ReportError(RejectCode.NO_CONFIGURATION, "response")
    return found


def command(name: str, **parameters: object) -> bytes:
    """A command, with its parameters where it has any. Section "Setting configuration parameters"."""
    order: dict[str, object] = {"command": name}
    if parameters:
        order["parameters"] = parameters
    return json.dumps(order).encode("ascii") + b"\n"


def text(report: Mapping[str, object], name: str) -> str:
    """Field that is a text; ReportError for another."""
    found = report.get(name)
    if not isinstance(found, str):
        if name == "format":
            raise ReportError(RejectCode.FORMAT, str(report.get("type", "report")))
        raise ReportError(RejectCode.TYPE, "report")
    return found


def _number(report: Mapping[str, object], name: str, low: float, high: float, kind: str = "velocity") -> float:
    found = report.get(name)
    if isinstance(found, bool) or not isinstance(found, int | float) or not low <= found <= high:
        raise ReportError(RejectCode.FIELD, kind, name)
    return float(found)


def _speed(report: Mapping[str, object], name: str) -> float:
    return _number(report, name, -FASTEST_mps, FASTEST_mps)


def _whole(report: Mapping[str, object], name: str) -> int:
    found = report.get(name)
    if isinstance(found, bool) or not isinstance(found, int) or not 0 <= found < 1 << 63:
        raise ReportError(RejectCode.FIELD, "velocity", name)
    return found


def _flag(report: Mapping[str, object], name: str) -> bool:
    found = report.get(name)
    if not isinstance(found, bool):
        raise ReportError(RejectCode.FIELD, "velocity", name)
    return found
