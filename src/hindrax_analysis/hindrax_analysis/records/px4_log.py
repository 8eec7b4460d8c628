"""Logs of PX4 (.ulg): velocities, attitude, rates, pulses and supply voltage, read by pyulog.

Format: PX4 guide, "ULog File Format". Fields: PX4's messages VehicleLocalPosition, VehicleAttitude (w, x, y, z from
front, right, down to north, east, down), VehicleAngularVelocity, ActuatorOutputs, BatteryStatus.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np

from hindrax_analysis.records.bag_track import tilts_of
from hindrax_core.errors import HindraxError, UsageError
from hindrax_ident.arrays import Array, array

Quantity: TypeAlias = Literal["velocity", "attitude", "rate", "pulses", "supply"]
Tables: TypeAlias = dict[Quantity, tuple[Array, Array]]
"""Quantity -> times (n,) [s] and rows (n, k): m/s in north, east, down; roll, pitch, yaw [rad]; rad/s; us; V."""

ENDING = ".ulg"
OUTPUTS = 16
FIELDS: dict[str, tuple[Quantity, tuple[str, ...]]] = {
    "vehicle_local_position": ("velocity", ("vx", "vy", "vz")),
    "vehicle_attitude": ("attitude", tuple(f"q[{n}]" for n in range(4))),
    "vehicle_angular_velocity": ("rate", tuple(f"xyz[{n}]" for n in range(3))),
    "actuator_outputs": ("pulses", tuple(f"output[{n}]" for n in range(OUTPUTS))),
    "battery_status": ("supply", ("voltage_v",)),
}
VALID = ("v_xy_valid", "v_z_valid")
"""Fields without which a row is no measurement."""


def tables_of(path: Path, channels: Sequence[int]) -> Tables:
    """Read a log; of several drivers of outputs that which moved one of these channels, else the first."""
    try:
        from pyulog import ULog  # noqa: PLC0415  # a vehicle does without it
    except ImportError as error:
        raise HindraxError(f"{path}: logs of PX4 need pyulog, which a set-up for the desk brings") from error
    try:
        datasets = ULog(str(path), list(FIELDS)).data_list
        found: dict[Quantity, list[tuple[Array, Array]]] = {}
        for one in sorted(datasets, key=lambda one: int(one.multi_id)):
            quantity, fields = FIELDS[one.name]
            found.setdefault(quantity, []).append(_rows(one.data, fields))
    except Exception as error:  # pyulog raises plain ones on garbage
        raise UsageError(f"{path}: is no log of PX4 that pyulog can read ({error!r})") from error
    tables: Tables = {quantity: some[0] for quantity, some in found.items() if len(some[0][0])}
    ours = [channel for channel in channels if channel < OUTPUTS]
    moved = [one for one in found.get("pulses", ()) if (one[1] != one[1][:1])[:, ours].any()]
    if moved:
        tables["pulses"] = moved[0]
    if "attitude" in tables:
        t, turned = tables["attitude"]
        tables["attitude"] = t, _roll_pitch_yaw(turned)
    return tables


def _rows(data: Mapping[str, Any], fields: Sequence[str]) -> tuple[Array, Array]:
    """Times and valid rows; of a time that steps back nothing."""
    # What an estimator says is true when its sample was taken, not when it was published.
    sampled = data.get("timestamp_sample")
    t = data["timestamp"] if sampled is None or not np.all(sampled) else sampled
    t_s = array(np.asarray(t, dtype=np.float64) * 1e-6)
    kept = np.diff(np.maximum.accumulate(t_s), prepend=-np.inf) > 0.0
    for name in VALID:
        kept &= np.asarray(data.get(name, 1)) != 0
    rows = np.column_stack([np.asarray(data[name], dtype=np.float64) for name in fields])
    return array(t_s[kept]), array(rows[kept])


def _roll_pitch_yaw(quaternions: Array) -> Array:
    """Angles (n, 3) [rad] of unit quaternions w, x, y, z: (n, 4)."""
    w, x, y, z = quaternions.T
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    return array(np.column_stack([tilts_of(array(quaternions[:, [1, 2, 3, 0]])), yaw]))
