"""The analysis as a library: read a bag, identify, predict, plot, allocate. No stack has to run.

    from hindrax_analysis import api as hindrax

A table is a mapping from names to columns of one length, as `pandas.DataFrame(table)` takes it; neither pandas nor
xarray is needed here. Tutorial: docs/how-to/analyze-in-python.ipynb.
"""

import warnings
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from hindrax_analysis.identification.record_identification import (
    IdentificationTask,
    axes_named,
    identify_sources,
    open_sources,
    recorded_vehicle,
    usual_gain_sigma,
)
from hindrax_analysis.records.autopilot_vehicle import BOX, logged_wiring, wired
from hindrax_analysis.records.third_party_bag import TopicSelection, topics_of
from hindrax_bag.read.mcap_records import Damage
from hindrax_bag.read.message_columns import message_rows
from hindrax_control.allocation.allocator import Allocator
from hindrax_core.errors import UsageError
from hindrax_core.readings import Vec6
from hindrax_core.signals import Allocation
from hindrax_core.text.digits import TWO_SIDED_95
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.results import Results
from hindrax_ident.model.model_parameters import parameters_of
from hindrax_ident.model.motion_model import MOTIONS, axis_units, model_of
from hindrax_ident.model.simulation import Grid, Trajectory, trajectory
from hindrax_ident.tuning import Tuning

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["allocate", "coefficients", "identify", "load_vehicle", "plot", "predict", "read", "topics"]

Table = Mapping[str, np.ndarray[Any, Any]]


def topics(bag: str | Path) -> dict[str, str]:
    """Return the topics of a bag and their types; UsageError for what is no bag."""
    return topics_of(Path(bag))


def read(bag: str | Path, topic: str) -> Table:
    """Return the messages of a topic as a table: `time_s` since the first message of the bag, then every field.

    Parameters
    ----------
    bag
        Bag of any kind that `./hindrax bag info` knows: a folder or a file.
    topic
        Its full name, such as `/hindrax/navigation/odometry`.

    Returns
    -------
    Table
        Columns (n,), one row per message. Fields of fields have dots in their names, elements of lists numbers. The
        fields are those of the first message; a number that a later one lacks is NaN. Units and axes as in the message.

    Raises
    ------
    UsageError
        For what is no bag, and for a topic without messages; it names those that there are.
    """
    damage = Damage()
    rows = [{"time_s": time_s} | fields for _, time_s, _, fields in message_rows(Path(bag), {topic}, damage=damage)]
    for sentence in damage.sentences:
        warnings.warn(f"{bag}: {sentence}", stacklevel=2)
    if not rows:
        raise UsageError(f"{bag}: no message on {topic}; there are {', '.join(sorted(topics(bag)))}")
    return {name: np.array([row.get(name, np.nan) for row in rows]) for name in rows[0]}


def identify(
    *records: str | Path,
    vehicle: Vehicle | None = None,
    motions: Collection[str] = (),
    odometry: str = "",
    wrench: str = "",
    frame: str = "",
    gain_sigma: float | None = None,
) -> Results:
    """Identify over bags, run folders or CSV files; several are pooled. Same as `./hindrax identify`.

    Parameters
    ----------
    *records
        Records of one vehicle, flown in any order.
    vehicle
        Thrusters, masses and prior values; without it the vehicle file in the first bag. One of the box is wired as an
        ArduSub's log says.
    motions
        Names of axes (`surge`) or motions (`heave_up`); all that moved by default.
    odometry, wrench
        Topics of velocity and force in a third-party bag; found by their types where there is one of each.
    frame
        Axes: `flu` (ROS), `fsd` (SNAME) or `world` (velocities of an odometry); by default those of the frame names.
    gain_sigma
        Relative deviation of the gain of the force [-]; by default 0.1 for a vehicle file without thrusters, whose
        force nobody has calibrated, else by its curves.

    Returns
    -------
    Results
        Coefficients in SNAME axes with their standard deviations, and a verdict, by motion.

    Raises
    ------
    UsageError
        Names what is missing: record, topic, vehicle, or a motion of that name.
    """
    selection = TopicSelection(odometry, wrench, frame)
    paths = [Path(record) for record in records]
    if vehicle is not None and vehicle.name in BOX and (wiring := logged_wiring(paths)):
        vehicle = wired(vehicle, wiring)
    sources = open_sources(paths, selection, vehicle)
    if not sources:
        raise UsageError("found no record, wanted at least one")
    of = vehicle or recorded_vehicle(sources[0])
    if of is None:
        raise UsageError(f"{records[0]}: holds no vehicle file; name one by vehicle=load_vehicle(...)")
    sigma = usual_gain_sigma(of, sources[0]) if gain_sigma is None else gain_sigma
    task = IdentificationTask(tuple(axes_named(tuple(motions))), tuning=Tuning(wrench_gain_sigma=sigma))
    return identify_sources(sources, of, task).results


def coefficients(results: Results) -> Table:
    """Return a table with one row per motion and coefficient: of the fit, and as it is quoted.

    Parameters
    ----------
    results
        Those of `identify`.

    Returns
    -------
    dict of arrays (n,)
        `motion`, `coefficient`, `value` of the fit, `std` (with calibration where known), `unit`, `identifiable`,
        `truth` of a mock; `corrected` by what is probable of each influence, and its 95 % interval, `low95` and
        `high95`. NaN where it is not known.
    """
    rows = [
        (motion, name, one.value, one.std_calibrated if np.isfinite(one.std_calibrated) else one.std, one.unit,
         result.identifiable, np.nan if one.truth is None else one.truth,
         *((np.nan,) * 3 if one.corrected is None else (one.corrected.value, *one.corrected.interval95)))
        for motion, result in results.motions.items()
        for name, one in result.coefficients.items()
    ]  # fmt: skip
    names = ("motion", "coefficient", "value", "std", "unit", "identifiable", "truth", "corrected", "low95", "high95")
    return {name: np.array([row[at] for row in rows]) for at, name in enumerate(names)}


def predict(results: Results, axis: str, time_s: ArrayLike, force: ArrayLike, start: float = 0.0) -> Array:
    """Return the velocity along an axis that identified coefficients give for a force.

    The vehicle is upright, and at rest along the other axes: (m + m_a) dv/dt = force - k_q |v| v - k_l v - b.

    Parameters
    ----------
    results
        What `identify` returned.
    axis
        `surge`, `sway`, `heave`, `roll`, `pitch` or `yaw` (SNAME).
    time_s : (n,) [s]
        Rising, two at least.
    force : (n,) [N, N m]
        Along the axis, each held until the next time; the last one acts no more.
    start : [m/s, rad/s]
        Velocity at the first time.

    Returns
    -------
    Array
        Velocity (n,) [m/s, rad/s] at the given times, by `hindrax_ident.model.simulation`.

    Raises
    ------
    UsageError
        Where a coefficient of the axis is missing, where times do not rise, or where no motion follows.
    """
    index = axes_named([axis])[0]
    model = model_of(results.vehicle, index)
    values = {name: {key: one.value for key, one in of.coefficients.items()} for name, of in results.motions.items()}
    theta = parameters_of(model, values)
    t, f = array(np.asarray(time_s, dtype=float)), array(np.asarray(force, dtype=float))
    if t.shape != f.shape or len(t) < 2 or not np.all(np.diff(t) > 0.0):
        raise UsageError(f"found times {t.shape} and forces {f.shape}, wanted as many of both, and rising times")
    grid = Grid(t, np.arange(len(t)) == 0, np.concatenate(([0.0], f[:-1] * np.diff(t))))
    path = trajectory(model, theta, grid, Trajectory(np.full(len(t), start), np.zeros(len(t))))
    if path is None:
        raise UsageError(f"{axis}: no motion follows from these coefficients and forces; are the units right?")
    return path.v


def plot(results: Results, motion: str, axes: "Axes | None" = None) -> "Axes":
    """Draw the drag of a motion over its speeds with the 95 % interval; needs matplotlib.

    Parameters
    ----------
    results
        What `identify` returned.
    motion
        A motion with a drag curve, such as `surge`.
    axes
        Where to draw; by default axes of a new figure.

    Returns
    -------
    Axes
        Those drawn on: speed [m/s, rad/s] to the right, drag [N, N m] upward.

    Raises
    ------
    UsageError
        For a motion without a drag curve.
    """
    from matplotlib import pyplot as plt  # noqa: PLC0415  # only who plots waits for it

    result = results.motions.get(motion)
    if result is None or result.drag is None:
        raise UsageError(f"{motion}: has no drag curve; there is one of {', '.join(results.motions) or 'nothing'}")
    shown = plt.subplots()[1] if axes is None else axes
    drag, (speed_unit, force_unit) = result.drag, axis_units(MOTIONS[motion].axis)
    band = TWO_SIDED_95 * np.where(np.isfinite(drag.std_calibrated), drag.std_calibrated, drag.std)
    force, low, high = drag.force, drag.force - band, drag.force + band
    if drag.corrected is not None:
        force, low, high = drag.corrected.center, drag.corrected.low95, drag.corrected.high95
    shown.fill_between(drag.speed, low, high, alpha=0.25, label="95 % interval")
    shown.plot(drag.speed, force, label=motion)
    shown.set_xlabel(f"speed [{speed_unit}]")
    shown.set_ylabel(f"drag [{force_unit}]")
    shown.legend()
    return shown


def allocate(vehicle: Vehicle, wrench: Vec6, disabled: Collection[str] = ()) -> Allocation:
    """Return forces and pulses of the thrusters for a wrench, as the stack would send them.

    Parameters
    ----------
    vehicle
        Positions, directions and curves of the thrusters.
    wrench : (6,) [N, N m]
        About the center of mass, SNAME axes.
    disabled
        Names of thrusters that must stand still.

    Returns
    -------
    Allocation
        Forces [N], pulses [us] in the order of the vehicle file, and the wrench that they achieve.

    Raises
    ------
    UsageError
        For a name that no thruster has.
    """
    allocator = Allocator(vehicle)
    unknown = sorted(set(disabled) - set(allocator.names))
    if unknown:
        raise UsageError(f"found {unknown[0]!r}, wanted some of {', '.join(allocator.names)}")
    return allocator.allocate(wrench, frozenset(disabled))
