"""Logs of autopilots: velocities, attitude and pulses of ArduPilot (DataFlash .bin, telemetry .tlog) or PX4 (.ulg).

Velocities are those of the autopilot's estimator, in north, east, down: they are turned into body axes by its attitude.
Pulses become forces by the thrust curves of the vehicle file at the logged supply voltage. ArduPilot's are read by
pymavlink: its log messages XKF1, NKF1, ATT, IMU, RCOU, BAT; MAVLink common LOCAL_POSITION_NED, ATTITUDE,
SERVO_OUTPUT_RAW, SYS_STATUS. PX4's are read by pyulog: PX4 guide, "ULog File Format", with its messages
VehicleLocalPosition, VehicleAttitude (w, x, y, z from front, right, down to north, east, down), VehicleAngularVelocity,
ActuatorOutputs, BatteryStatus.
"""

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from scipy.spatial.transform import Rotation

from hindrax_analysis.records.bag_track import tilts_of
from hindrax_analysis.records.recording import Recording, wrenches_of_pulses
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array

Quantity: TypeAlias = Literal["velocity", "attitude", "rate", "pulses", "supply"]
Tables: TypeAlias = dict[Quantity, tuple[Array, Array]]
"""Quantity -> times (n,) [s] and rows (n, k): m/s in north, east, down; roll, pitch, yaw [rad]; rad/s; us; V."""

ULOG = ".ulg"
ENDINGS = (".bin", ".tlog", ULOG)
CHANNELS = 14
DEGREE = math.pi / 180.0
FIELDS: dict[str, tuple[tuple[Quantity, float, tuple[str, ...]], ...]] = {
    "XKF1": (("velocity", 1.0, ("VN", "VE", "VD")),),
    "NKF1": (("velocity", 1.0, ("VN", "VE", "VD")),),
    "ATT": (("attitude", DEGREE, ("Roll", "Pitch", "Yaw")),),
    "IMU": (("rate", 1.0, ("GyrX", "GyrY", "GyrZ")),),
    "RCOU": (("pulses", 1.0, tuple(f"C{n}" for n in range(1, CHANNELS + 1))),),
    "BAT": (("supply", 1.0, ("Volt",)),),
    "LOCAL_POSITION_NED": (("velocity", 1.0, ("vx", "vy", "vz")),),
    "ATTITUDE": (("attitude", 1.0, ("roll", "pitch", "yaw")), ("rate", 1.0, ("rollspeed", "pitchspeed", "yawspeed"))),
    "SERVO_OUTPUT_RAW": (("pulses", 1.0, tuple(f"servo{n}_raw" for n in range(1, CHANNELS + 1))),),
    "SYS_STATUS": (("supply", 1e-3, ("voltage_battery",)),),
}
"""Message -> quantities, their factor to SI, and their fields."""
WANTED: dict[Quantity, str] = {
    "velocity": "velocities (XKF1, LOCAL_POSITION_NED or vehicle_local_position)",
    "attitude": "attitude (ATT, ATTITUDE or vehicle_attitude)",
    "pulses": "pulses (RCOU, SERVO_OUTPUT_RAW or actuator_outputs)",
}
OUTPUTS = 16
PX4_FIELDS: dict[str, tuple[Quantity, tuple[str, ...]]] = {
    "vehicle_local_position": ("velocity", ("vx", "vy", "vz")),
    "vehicle_attitude": ("attitude", tuple(f"q[{n}]" for n in range(4))),
    "vehicle_angular_velocity": ("rate", tuple(f"xyz[{n}]" for n in range(3))),
    "actuator_outputs": ("pulses", tuple(f"output[{n}]" for n in range(OUTPUTS))),
    "battery_status": ("supply", ("voltage_v",)),
}
VALID = ("v_xy_valid", "v_z_valid")
"""Fields without which a row is no measurement."""
INSTANCES = ("C", "I", "Inst", "Instance", "port")
"""Fields that number the sensors, estimators or ports of a kind; the first of each is used."""
MOST_ROWS = 2_000_000
LEAST_V, MOST_V = 5.0, 60.0
"""Another voltage is that of an unconnected monitor."""
STEP_V = 0.1
"""Resolution of the voltage in the thrust curves."""


def read_log(path: Path, vehicle: Vehicle | None) -> Recording:
    """Read a log in SNAME axes. UsageError names what is missing, or that the vehicle file is."""
    if vehicle is None or not vehicle.thrusters:
        raise UsageError(f"{path}: holds pulses; name a vehicle file with thrusters and curves by --vehicle")
    # pymavlink prints each byte that it skips, pyulog what is corrupt.
    with Path(os.devnull).open("w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
        tables = _tables(path, vehicle)
    for name, words in WANTED.items():
        if name not in tables:
            there = ", ".join(sorted(tables)) or "nothing that is known"
            raise UsageError(f"{path}: found {there}, wanted the {words}")
    origin = min(float(t[0]) for t, _ in tables.values())
    tables = {name: (array(t - origin), rows) for name, (t, rows) in tables.items()}
    attitude_t, attitude = tables["attitude"]
    velocity_t, world = tables["velocity"]
    steady = np.unwrap(attitude, axis=0)
    turned = array(np.column_stack([np.interp(velocity_t, attitude_t, column) for column in steady.T]))
    moved = array(Rotation.from_euler("ZYX", turned[:, ::-1]).inv().apply(world))  # Fossen 2011 eq. 2.18
    parts = [(velocity_t, array(np.column_stack([moved, np.full_like(moved, np.nan)])))]
    if "rate" in tables:
        rate_t, rates = tables["rate"]
        parts.append((rate_t, array(np.column_stack([np.full_like(rates, np.nan), rates]))))
    t, rows = (array(np.concatenate(column)) for column in zip(*parts, strict=True))
    order = np.argsort(t, kind="stable")
    pulses_t, wrench, supply_note = _wrenches(path, tables, vehicle)
    tilts = array(np.column_stack([attitude[:, :2], np.full(len(attitude), np.nan)]))
    return Recording(
        str(path), array(t[order]), array(rows[order]), pulses_t, wrench, attitude_t, tilts, origin,
        ("velocities are those of the autopilot's estimator, turned into body axes by its attitude", supply_note),
    )  # fmt: skip


def _tables(path: Path, vehicle: Vehicle) -> Tables:
    """Times [s since 1970, or since power-up] and rows of each quantity; times that step back are left out."""
    if not path.stat().st_size:
        raise UsageError(f"{path}: is empty")
    if path.suffix.lower() == ULOG:
        return _px4_tables(path, [thruster.channel for thruster in vehicle.thrusters])
    tables: dict[Quantity, tuple[list[float], list[list[float]]]] = {}
    for message in _messages(path):
        if any(getattr(message, name, 0) for name in INSTANCES):
            continue
        for quantity, factor, fields in FIELDS[message.get_type()]:
            times, rows = tables.setdefault(quantity, ([], []))
            at_s = float(message._timestamp)  # noqa: SLF001  # pymavlink's own name of it
            if not times or at_s > times[-1]:
                times.append(at_s)
                rows.append([factor * float(getattr(message, name, 0) or 0) for name in fields])
            if len(times) > MOST_ROWS:
                raise UsageError(f"{path}: found more than {MOST_ROWS} of {message.get_type()}; cut the log first")
    return {name: (array(np.array(t)), array(np.array(rows))) for name, (t, rows) in tables.items()}


def _messages(path: Path) -> Iterator[Any]:
    try:
        from pymavlink import mavutil  # noqa: PLC0415  # a vehicle does without it
    except ImportError as error:
        raise HindraxError(f"{path}: logs of ArduPilot need pymavlink; `./hindrax setup --all` installs it") from error
    try:
        log = mavutil.mavlink_connection(str(path))
        while (message := log.recv_match(type=list(FIELDS))) is not None:
            yield message
    except Exception as error:  # pymavlink raises plain ones on garbage
        raise UsageError(f"{path}: is no log of ArduPilot that pymavlink can read ({error!r})") from error


def _px4_tables(path: Path, channels: Sequence[int]) -> Tables:
    """Read a log; of several drivers of outputs that which moved one of these channels, else the first."""
    try:
        from pyulog import ULog  # noqa: PLC0415  # a vehicle does without it
    except ImportError as error:
        raise HindraxError(f"{path}: logs of PX4 need pyulog; `./hindrax setup --all` installs it") from error
    try:
        datasets = ULog(str(path), list(PX4_FIELDS)).data_list
        found: dict[Quantity, list[tuple[Array, Array]]] = {}
        for one in sorted(datasets, key=lambda one: int(one.multi_id)):
            quantity, fields = PX4_FIELDS[one.name]
            found.setdefault(quantity, []).append(_px4_rows(one.data, fields))
    except Exception as error:  # pyulog raises plain ones on garbage
        raise UsageError(f"{path}: is no log of PX4 that pyulog can read ({error!r})") from error
    tables: Tables = {quantity: some[0] for quantity, some in found.items() if len(some[0][0])}
    ours = [channel for channel in channels if channel < OUTPUTS]
    moved = [one for one in found.get("pulses", ()) if (one[1] != one[1][:1])[:, ours].any()]
    if moved:
        tables["pulses"] = moved[0]
    if "attitude" in tables:
        t, turned = tables["attitude"]
        w, x, y, z = turned.T
        yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        tables["attitude"] = t, array(np.column_stack([tilts_of(array(turned[:, [1, 2, 3, 0]])), yaw]))
    return tables


def _px4_rows(data: Mapping[str, Any], fields: Sequence[str]) -> tuple[Array, Array]:
    """Times and valid rows; of a time that steps back nothing."""
    # An estimate is valid when its sample was taken, not when it was published.
    sampled = data.get("timestamp_sample")
    t = data["timestamp"] if sampled is None or not np.all(sampled) else sampled
    t_s = array(np.asarray(t, dtype=np.float64) * 1e-6)
    kept = np.diff(np.maximum.accumulate(t_s), prepend=-np.inf) > 0.0
    for name in VALID:
        kept &= np.asarray(data.get(name, 1)) != 0
    rows = np.column_stack([np.asarray(data[name], dtype=np.float64) for name in fields])
    return array(t_s[kept]), array(rows[kept])


def _wrenches(path: Path, tables: Tables, vehicle: Vehicle) -> tuple[Array, Array, str]:
    """Times (n,) [s], wrenches (n, 6) [N, N m], and a note on the supply voltage."""
    t, channels = tables["pulses"]
    volts, note = np.full(len(t), vehicle.supply_V), f"no supply voltage is logged: {vehicle.supply_V:g} V is assumed"
    supply_t, supply = tables.get("supply", (array(np.zeros(0)), array(np.zeros((0, 1)))))
    connected = (supply[:, 0] >= LEAST_V) & (supply[:, 0] <= MOST_V)
    if connected.any():
        logged = supply[connected, 0]
        volts = np.interp(t, supply_t[connected], logged)
        note = f"thrust is that of the curves at the logged {logged.min():.1f} to {logged.max():.1f} V"
    supplies_V = (STEP_V * np.round(volts / STEP_V)).tolist()
    wrenches = wrenches_of_pulses(str(path), channels.tolist(), supplies_V, vehicle)
    return t, wrenches, f"pulses of the outputs are converted by the vehicle file; {note}"
