"""Body axes of a CSV file where nobody has named them: depth and angles say which way velocities are counted.

Half of the world writes z down, the other half z up (REP-103), and most headers say neither. Drag alone does not mind.
But with the wrong sense a vehicle that sinks would float, its drag downward would be the one upward, and gravity would
turn it over. The depth is the integral of the velocity down, an angle is the integral of its rate: what runs against
them is counted the other way.
"""

from collections.abc import Collection, Mapping
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from hindrax_analysis.records.bag_track import compare_frames, compare_rates, tilts_of, to_body
from hindrax_analysis.records.csv.agreement import slope_of
from hindrax_analysis.records.csv.columns import QUATERNION
from hindrax_ident.arrays import Array, array

LEAST_SLOPE = 0.5
"""Size of the slope of a depth over its rate from which they are the same motion."""
OFF_UNIT = 0.1
"""Difference of a quaternion's size from 1 beyond which it is none."""
HIGH_m = -0.2
"""Median of a depth below which it is a height, where it does not rise as far above zero."""


def with_depths(columns: Mapping[str, Array]) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Have a column of depths count down from the surface.

    Parameters
    ----------
    columns
        By name, (n,) each.

    Returns
    -------
    tuple[dict[str, Array], tuple[str, ...]]
        The columns, (n,) each, and what was assumed.
    """
    depth = columns.get("depth")
    if depth is None or not np.isfinite(depth).any():
        return dict(columns), ()
    middle, highest = np.nanpercentile(depth, [50.0, 99.0])
    # No vehicle flies above the water: what is on both sides of zero is a depth that counts from somewhere below.
    if middle > HIGH_m or highest > -HIGH_m:
        return dict(columns), ()
    return dict(columns) | {"depth": array(-depth)}, ("depths are heights above the surface, by their sign",)


OF_WORLD = {"vn", "ve", "yaw"}
"""Columns that show the velocities of surge and sway."""
WITHOUT_HEADING = "velocities north and east are not used: they need a column yaw, the heading clockwise from north"
PLACE = {"px", "py", "yaw"}
"""Columns that show the way along surge and sway."""


def with_angles_of_quaternion(columns: Mapping[str, Array]) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Have roll, pitch and yaw where the file has a quaternion and not those.

    They are in the axes of the quaternion, whichever these are. Beside velocities of the world there is no yaw: north
    and east of the one say nothing of the x and y of the other. A quaternion that never changes was never filled in.

    Parameters
    ----------
    columns
        By name, (n,) each.

    Returns
    -------
    tuple[dict[str, Array], tuple[str, ...]]
        The columns, (n,) each, without the quaternion, and what was assumed.
    """
    out = {name: values for name, values in columns.items() if name not in QUATERNION}
    if not set(columns) >= set(QUATERNION):
        return out, ()
    quaternions = np.column_stack([columns[name] for name in QUATERNION])
    sizes = np.linalg.norm(quaternions, axis=1)
    known = np.abs(sizes - 1.0) < OFF_UNIT
    quaternions = np.where(known[:, np.newaxis], quaternions / np.where(known, sizes, 1.0)[:, np.newaxis], np.nan)
    x, y, z, w = quaternions.T
    roll, pitch = tilts_of(array(quaternions)).T
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    angles = {"roll": roll, "pitch": pitch} | ({} if "vn" in columns else {"yaw": yaw})
    made = {name: array(values) for name, values in angles.items() if name not in out}
    moved = bool(known.any()) and bool(np.ptp(quaternions[known], axis=0).any())
    note = (f"{', '.join(made)} are those of the quaternion",) if made and moved else ()
    return out | (made if note else {}), note


def with_velocities_of_world(columns: Mapping[str, Array]) -> tuple[dict[str, Array], tuple[str, ...], tuple[str, ...]]:
    """Turn velocities north, east and down into those of the body that the file does not have.

    v_body = R(roll, pitch, yaw)' (vn, ve, vd), Fossen 2011 eq. 2.18; SNAME axes. A file without roll and pitch is of a
    level vehicle, and tells surge and sway only.

    Parameters
    ----------
    columns
        By name, (n,) each; angles in radians.

    Returns
    -------
    tuple[dict[str, Array], tuple[str, ...], tuple[str, ...]]
        The columns, (n,) each, with u, v and w; which of them were made; what was assumed.
    """
    out = {name: values for name, values in columns.items() if name not in ("vn", "ve", "vd")}
    if not set(columns) >= OF_WORLD:
        lost = {"vn", "ve"} <= set(columns) and not {*"uv"} & set(columns)
        return dict(columns), (), (WITHOUT_HEADING,) if lost else ()
    tilted = {"vd", "roll", "pitch"} <= set(columns)
    down = columns["vd"] if tilted else np.zeros_like(columns["vn"])
    attitude = _attitude(columns, ("yaw", "pitch", "roll") if tilted else ("yaw",))
    body = attitude.inv().apply(np.column_stack([columns["vn"], columns["ve"], down]))
    made = [name for name in ("uvw" if tilted else "uv") if name not in out]
    out |= {name: array(body[:, "uvw".index(name)]) for name in made}
    how = "roll, pitch and yaw" if tilted else "yaw, as of a level vehicle"
    notes = (f"{', '.join(made)} are velocities north and east, turned by {how}",) if made else ()
    return out, tuple(made), notes


def with_axes_of_body(columns: Mapping[str, Array]) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Turn velocities and rates into body axes where pose beside them shows that they are in those of the world.

    Simulators give both as their engine has them, and their names are those of body axes. Positions, attitude and
    velocities are of one world here, whichever way its z axis points: R(roll, pitch, yaw) turns one into the other.

    Parameters
    ----------
    columns
        By name, (n,) each; angles in radians.

    Returns
    -------
    tuple[dict[str, Array], tuple[str, ...]]
        The columns, (n,) each, and what was assumed.
    """
    out, notes = dict(columns), []
    if not set(columns) >= PLACE:
        return out, ()
    t, level = columns["t"], np.zeros_like(columns["t"])
    quaternions = array(_attitude(columns, ("yaw", "pitch", "roll")).as_quat())
    positions = array(np.column_stack([_between(t, columns["px"]), _between(t, columns["py"]), level]))
    looks = (
        ("uvw", {*"uv"}, partial(compare_frames, t, positions, quaternions), "positions change"),
        ("pqr", {*"pqr"}, partial(compare_rates, t, quaternions), "attitude changes"),
    )
    for names, needed, compared, how in looks:
        if not needed <= set(columns):
            continue
        vectors = array(np.column_stack([columns.get(one, level) for one in names]))
        found = compared(vectors)
        if found is not None and found.is_world:
            body, there = to_body(vectors, quaternions), [one for one in names if one in columns]
            out |= {one: array(body[:, names.index(one)]) for one in there}
            notes.append(f"{', '.join(there)} are in the axes of the world, as the {how}: turned by the attitude")
    return out, tuple(notes)


def _attitude(columns: Mapping[str, Array], angles: Collection[str]) -> Rotation:
    """Attitude of the body in each row, of those of the angles that the file has; the others are level."""
    level = np.zeros_like(columns["t"])
    turned = [
        _at_all_times(columns["t"], columns[one]) if one in angles and one in columns else level
        for one in ("yaw", "pitch", "roll")
    ]
    return Rotation.from_euler("ZYX", np.column_stack(turned))


def _at_all_times(t: Array, angle: Array) -> Array:
    """Angles (n,) [rad] between those that are known: rows of other instruments have none."""
    known = np.isfinite(angle)
    steady = angle.copy()
    order = np.flatnonzero(known)[np.argsort(t[known], kind="stable")]
    steady[order] = np.unwrap(angle[order])
    return _between(t, steady)


def _between(t: Array, values: Array) -> Array:
    """Values (n,) between those that are known."""
    known = np.flatnonzero(np.isfinite(values))
    known = known[np.argsort(t[known], kind="stable")]
    return array(np.interp(t, t[known], values[known])) if len(known) else values


def frame_by_depth(columns: Mapping[str, Array]) -> str:
    """Frame in which the velocity down is the rate of the depth.

    Parameters
    ----------
    columns
        By name, (n,) each, with the times "t" [s], depths and velocities in SI.

    Returns
    -------
    str
        fsd or flu; empty where depth and velocity do not tell.
    """
    slope = slope_of(columns["t"], columns["depth"], columns["w"]) if {"depth", "w"} <= set(columns) else 0.0
    return "" if abs(slope) < LEAST_SLOPE else "fsd" if slope > 0.0 else "flu"


def with_angles(columns: Mapping[str, Array]) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Have roll and pitch count as their rates do.

    Parameters
    ----------
    columns
        By name, (n,) each, with the times "t" [s], angles and rates in SI.

    Returns
    -------
    tuple[dict[str, Array], tuple[str, ...]]
        The columns, (n,) each, and what was assumed.
    """
    out, notes = dict(columns), []
    for angle, rate in (("roll", "p"), ("pitch", "q")):
        if {angle, rate} <= set(out) and slope_of(out["t"], out[angle], out[rate]) < -LEAST_SLOPE:
            out[angle] = array(-out[angle])
            notes.append(f"{angle} is counted against {rate}, and was turned")
    return out, tuple(notes)
