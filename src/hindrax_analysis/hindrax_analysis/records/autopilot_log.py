"""Logs of autopilots: velocities, attitude, depth and pulses of ArduPilot (.bin, .tlog, BlueOS) or PX4 (.ulg).

Velocities are those of the autopilot's estimator, in north, east, down: they are turned into body axes by its attitude.
Pulses become forces by the thrust curves of the vehicle file at the logged supply voltage. Without velocities, rates
serve roll, pitch and yaw, and the water pressure serves heave. PX4's logs are read by pyulog: PX4 guide, "ULog File
Format", with its messages VehicleLocalPosition, VehicleAttitude (w, x, y, z from front, right, down to north, east,
down), VehicleAngularVelocity, ActuatorOutputs, BatteryStatus.
"""

import os
from collections.abc import Mapping, Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from hindrax_analysis.records.ardupilot_log import ArduPilotLog, Quantity, Tables, claimed, read_starts
from hindrax_analysis.records.bag_track import tilts_of
from hindrax_analysis.records.recording import Recording, forces_of_pulses, wrenches_of_forces
from hindrax_analysis.records.thruster_values import Supplies, supplies_at
from hindrax_control.allocation.thrust_curve import SERVO_US
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.text.screen_text import how_to_install
from hindrax_core.vehicle import VEHICLE_OF_FRAME, Vehicle
from hindrax_ident.arrays import Array, array

ULOG, ULOG_MAGIC = ".ulg", b"ULog"
ENDINGS = (".bin", ".tlog", ULOG)
WANTED: dict[Quantity, str] = {
    "attitude": "attitude (ATT, ATTITUDE or vehicle_attitude)",
    "pulses": "pulses (RCOU, SERVO_OUTPUT_RAW or actuator_outputs)",
}
MOTION: tuple[Quantity, ...] = ("velocity", "rate")
MORE = {
    ".bin": "; let the autopilot log it (LOG_BITMASK of an ArduSub: 180222 by default), and dive again",
    ".tlog": "; let the ground station ask for it, and dive again, or take the log of the autopilot (.bin)",
    ULOG: "; let the autopilot log it, and dive again, or write a CSV, where a column for each thruster may have "
    "newtons (thruster1_N) or, as actuator_motors, shares of full throttle (thruster1_ratio)",
}
"""What to do about a log that lacks something."""
OUTPUTS = 16
# Of two messages of a quantity the first is used: before release 1.10 the gyroscopes' own rates alone were logged.
PX4_FIELDS: dict[str, tuple[Quantity, tuple[str, ...]]] = {
    "vehicle_local_position": ("velocity", ("vx", "vy", "vz")),
    "vehicle_attitude": ("attitude", tuple(f"q[{n}]" for n in range(4))),
    "vehicle_angular_velocity": ("rate", tuple(f"xyz[{n}]" for n in range(3))),
    "sensor_combined": ("rate", tuple(f"gyro_rad[{n}]" for n in range(3))),
    "actuator_outputs": ("pulses", tuple(f"output[{n}]" for n in range(OUTPUTS))),
    "battery_status": ("supply", ("voltage_v",)),
}
VALID = ("v_xy_valid", "v_z_valid")
"""Fields without which a row is no measurement."""
GRAVITY, HEIGHT_SOURCE, BAROMETER = "BARO_SPEC_GRAV", "EK3_SRC1_POSZ", 1.0
"""Parameters of ArduPilot: specific gravity of the water, and where the estimator has its height from."""
PASCAL_PER_m, LEAST_SCALE = 9800.0, 0.002
"""Pressure of a metre of water of specific gravity 1 to ArduPilot (AP_Baro); least change of scale that counts."""
CONVERTED = "pulses of the outputs are converted by the vehicle file"
MOST_IMPOSSIBLE = 0.01
"""Rows of pulses that no output has, of all, which count as damage; more are another vehicle's or another unit's."""
LEAST_DEPTH_m = 0.05
"""A pressure that varies less is that of the air in the hull."""


def read_log(path: Path, vehicle: Vehicle | None) -> list[Recording]:
    """Read a log in SNAME axes.

    Parameters
    ----------
    path
        A .bin, .tlog or .ulg file, or a recording of BlueOS.
    vehicle
        Converts pulses to newtons; None: not known.

    Returns
    -------
    list[Recording]
        One for each start of the autopilot that has what a record needs.

    Raises
    ------
    UsageError
        Names what is missing, or that the vehicle file is.
    """
    if not path.stat().st_size:
        raise UsageError(f"{path}: is empty")
    if vehicle is None or not vehicle.thrusters:
        _require_known(path)
        if vehicle is None and path.suffix.lower() != ULOG:
            known = ", ".join(VEHICLE_OF_FRAME.values())
            raise UsageError(
                f"{path}: holds pulses, and no parameter that names the frame; name the vehicle by --vehicle: {known}, "
                "or a vehicle file with thrusters and curves"
            )
        raise UsageError(f"{path}: holds pulses; name a vehicle file with thrusters and curves by --vehicle")
    if path.suffix.lower() == ULOG:
        # pyulog prints what is corrupt.
        with Path(os.devnull).open("w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
            found, damaged = _px4_tables(path, [thruster.channel for thruster in vehicle.thrusters])
        starts = [found]
        notes = ["the file is damaged; what pyulog could not read is left out"] if damaged else []
    else:
        logs = read_starts(path)
        file = logs[0] if logs else ArduPilotLog()  # what is told of all starts alike
        scales = [_descent_scale(one.parameters, vehicle) for one in logs]
        starts = [_with_descent(one.tables, scale) for one, scale in zip(logs, scales, strict=True)]
        systems = ", ".join(str(number) for number in file.others)
        notes = [f"messages of other vehicles (MAVLink system {systems}) are left out"] if systems else []
        if file.damaged:
            where = "1 place" if file.damaged == 1 else f"{file.damaged} places"
            notes.append(f"the file is damaged in {where}; what is no message there is left out")
        if scaled := [scale for scale in scales if scale != 1.0]:
            notes.append(
                f"vertical velocities are scaled by {scaled[0]:.3f}: the autopilot's {GRAVITY} is that of other water "
                f"than the {vehicle.water.density_kgpm3:g} kg/m^3 of the vehicle file"
            )
    lacks = [_lacking(tables) for tables in starts]
    usable = [tables for tables, lacking in zip(starts, lacks, strict=True) if not lacking]
    if not usable:
        there = ", ".join(sorted({name for tables in starts for name in tables})) or "nothing that is known"
        wanted = next(iter(lacks), WANTED["pulses"])
        raise UsageError(f"{path}: found {there}, wanted the {wanted}{MORE.get(path.suffix.lower(), '')}")
    if len(starts) > 1:
        notes.insert(0, f"the autopilot started {len(starts)} times: each is a record")
    return [_recording(path, tables, vehicle, notes) for tables in usable]


def _descent_scale(parameters: Mapping[str, float], vehicle: Vehicle) -> float:
    """True vertical velocity in that of an ArduPilot whose estimator has its height from pressure.

    It takes 9800 Pa for a metre of water of specific gravity 1. In sea water that makes depths and vertical velocities
    2.4 % too large, and k_q of heave 4.7 % too small. 1 where the logged parameters do not say so.
    """
    if GRAVITY not in parameters or parameters.get(HEIGHT_SOURCE, BAROMETER) != BAROMETER:
        return 1.0
    scale = PASCAL_PER_m * parameters[GRAVITY] / (vehicle.water.density_kgpm3 * GRAVITY_mps2)
    return scale if abs(scale - 1.0) > LEAST_SCALE else 1.0


def _with_descent(tables: Tables, scale: float) -> Tables:
    """The tables with vertical velocities of the world scaled."""
    if scale == 1.0 or "velocity" not in tables:
        return tables
    t, world = tables["velocity"]
    return {**tables, "velocity": (t, array(world * (1.0, 1.0, scale)))}


def _require_known(path: Path) -> None:
    """Refuse by name what is no log at all: no vehicle file would help."""
    with path.open("rb") as log:
        known = log.read(len(ULOG_MAGIC)) == ULOG_MAGIC
    ending = path.suffix.lower()
    starts = [] if known or ending == ULOG else read_starts(path)
    if known or any(one.tables for one in starts):
        return
    if any(one.parameters for one in starts):
        raise UsageError(f"{path}: found parameters alone, wanted motion and pulses{MORE.get(ending, '')}")
    raise UsageError(f"{path}: found nothing that is known, wanted a log of ArduPilot or PX4")


def _lacking(tables: Tables) -> str:
    """What a record needs and a start lacks; empty where it lacks nothing."""
    if not any(name in tables for name in MOTION):
        return "velocities or rates (XKF1, IMU, LOCAL_POSITION_NED, ATTITUDE or vehicle_local_position)"
    return next((words for name, words in WANTED.items() if name not in tables), "")


def _recording(path: Path, tables: Tables, vehicle: Vehicle, of_log: Sequence[str]) -> Recording:
    origin = min(float(t[0]) for t, _ in tables.values())
    tables = {name: (array(t - origin), rows) for name, (t, rows) in tables.items()}
    attitude_t, attitude = tables["attitude"]
    parts, notes = _body_velocities(tables)
    if "rate" in tables:
        rate_t, rates = tables["rate"]
        parts.append((rate_t, array(np.column_stack([np.full_like(rates, np.nan), rates]))))
    t, rows = (array(np.concatenate(column)) for column in zip(*parts, strict=True))
    order = np.argsort(t, kind="stable")
    tables["pulses"], pulse_note = _possible_pulses(tables["pulses"], vehicle)
    pulses_t = tables["pulses"][0]
    forces, supplies = _forces(path, tables, vehicle)
    tilts_t = [attitude_t]
    tilts = [np.column_stack([attitude[:, :2], np.full(len(attitude), np.nan)])]
    depth = _depths(tables, vehicle)
    if depth is None and not np.isfinite(rows[:, 2]).any():
        flat = f"varies by less than {100.0 * LEAST_DEPTH_m:g} cm of water"
        notes.append(f"the pressure {flat if 'pressure' in tables else 'is not logged'}: heave cannot be identified")
    if depth is not None:
        depth_t, depths = depth
        tilts_t.append(depth_t)
        tilts.append(np.column_stack([np.full((len(depths), 2), np.nan), depths]))
    tilt_order = np.argsort(np.concatenate(tilts_t), kind="stable")
    return Recording(
        str(path), array(t[order]), array(rows[order]), pulses_t, wrenches_of_forces(forces, vehicle),
        array(np.concatenate(tilts_t)[tilt_order]), array(np.concatenate(tilts)[tilt_order]), origin,
        tuple(one for one in (*notes, pulse_note, f"{CONVERTED}; {supplies.note}", *of_log) if one), forces=forces,
        supply=supplies.known,
    )  # fmt: skip


def _body_velocities(tables: Tables) -> tuple[list[tuple[Array, Array]], list[str]]:
    """Velocities in body axes that the estimator claims, and notes on them."""
    known = claimed(tables)
    if known is None:
        return [], ["no velocities are logged: surge and sway cannot be identified"]
    t, world = known
    if not np.isfinite(world[:, 0]).any():
        return [], ["the estimator had no velocities (constant-position mode): surge and sway cannot be identified"]
    attitude_t, attitude = tables["attitude"]
    steady = np.unwrap(attitude, axis=0)
    turned = array(np.column_stack([np.interp(t, attitude_t, column) for column in steady.T]))
    kept = np.isfinite(world).all(axis=1)
    moved = array(Rotation.from_euler("ZYX", turned[kept][:, ::-1]).inv().apply(world[kept]))  # Fossen 2011 eq. 2.18
    rows = array(np.column_stack([moved, np.full_like(moved, np.nan)]))
    notes = ["velocities come from the autopilot's estimator, turned into body axes by its attitude"]
    if not kept.all():
        notes.append(f"for {100.0 * (1.0 - kept.mean()):.0f} % of the time the estimator claims none: left out")
    return [(array(t[kept]), rows)], notes


def _depths(tables: Tables, vehicle: Vehicle) -> tuple[Array, Array] | None:
    """Times and depths (n,) [m] by the water pressure; None without a pressure that varies as water does."""
    if "pressure" not in tables:
        return None
    t, rows = tables["pressure"]
    depths = array([vehicle.water.depth_m(pressure_Pa) for pressure_Pa in rows[:, 0].tolist()])
    return (t, depths) if np.ptp(depths) > LEAST_DEPTH_m else None


def _px4_tables(path: Path, channels: Sequence[int]) -> tuple[Tables, bool]:
    """Tables of a log of PX4, and whether it is damaged.

    Of several drivers of outputs that which moved one of these channels, else the first.
    """
    try:
        from pyulog import ULog  # noqa: PLC0415  # a vehicle does without it
    except ImportError as error:
        raise HindraxError(f"{path}: logs of PX4 need pyulog; {how_to_install('autopilot')}") from error
    try:
        log = ULog(str(path), list(PX4_FIELDS))
        found: dict[Quantity, list[tuple[Array, Array]]] = {}
        order = list(PX4_FIELDS)
        for one in sorted(log.data_list, key=lambda one: (order.index(one.name), int(one.multi_id))):
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
    return tables, bool(log.file_corruption)


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


def _possible_pulses(pulses: tuple[Array, Array], vehicle: Vehicle) -> tuple[tuple[Array, Array], str]:
    """Pulses without the few rows that a damaged file has and no output, and a note on them; many are an error."""
    t, rows = pulses
    ours = rows[:, [one.channel for one in vehicle.thrusters if one.channel < rows.shape[1]]]
    possible = ((ours == 0.0) | ((ours >= SERVO_US[0]) & (ours <= SERVO_US[1]))).all(axis=1)
    gone = int((~possible).sum())
    if not gone or gone > max(1.0, MOST_IMPOSSIBLE * len(rows)):
        return pulses, ""
    what = "1 row of pulses" if gone == 1 else f"{gone} rows of pulses"
    return (array(t[possible]), array(rows[possible])), f"{what} that no output has: damage, left out"


def _forces(path: Path, tables: Tables, vehicle: Vehicle) -> tuple[Array, Supplies]:
    """Forces (n, k) [N] of the thrusters, and the supply voltages that they were computed with."""
    t, channels = tables["pulses"]
    supply_t, supply = tables.get("supply", (array(np.zeros(0)), array(np.zeros((0, 1)))))
    supplies = supplies_at(t, supply_t, array(supply[:, 0]), vehicle)
    return forces_of_pulses(str(path), channels.tolist(), supplies.volts, vehicle), supplies
