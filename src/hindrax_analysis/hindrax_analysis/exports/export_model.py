"""Export model: a results file (coefficients.yaml), completed and made passive.

One reference point. Plant, identification and allocation are about the center of mass, so drag, added mass and wrench
of every export are too. The body origin of the vehicle file serves only to say where things sit.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from textwrap import wrap
from typing import TypeAlias, cast
from xml.etree import ElementTree as ET

import numpy as np

from hindrax_analysis.coefficients_file import MOCK_WORLD, TABULATED, SavedCoefficients
from hindrax_core.errors import HindraxError
from hindrax_core.readings import Vec3, Vec6
from hindrax_core.signals import ZERO6
from hindrax_core.text.digits import PLUS_MINUS, measured
from hindrax_core.thrust.curves import running
from hindrax_core.vehicle import AXES, Drag, Hydrodynamics, Thruster, Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.assess.results import MotionResult
from hindrax_ident.model.motion_model import MOTIONS, axis_units, coefficient_units


@dataclass(frozen=True, slots=True)
class ExportModel:
    """Complete vehicle, drag and added mass, and notes on how they were completed."""

    vehicle: Vehicle
    hydrodynamics: Hydrodynamics
    top_speed: Vec6
    """Largest tested speed per axis [m/s, rad/s]; formats with another drag law are fitted up to it."""
    source: str = ""
    notes: tuple[str, ...] = ()
    across: Vec6 = ZERO6
    """k_w of each axis: drag by the speed across it [N s^2/m^2, N m s^2]; the formats that can have it apply it."""

    def arm_m(self, position_m: Vec3) -> Vec3:
        """Position from the center of mass [m] of a point that the vehicle file gives from the body origin."""
        x, y, z = (float(a - b) for a, b in zip(position_m, self.vehicle.center_of_mass_m, strict=True))
        return (x, y, z)

    @property
    def buoyancy_arm_m(self) -> Vec3:
        """Center of buoyancy from the center of mass [m], SNAME axes."""
        return self.arm_m(self.vehicle.center_of_buoyancy_m)

    @property
    def added_mass(self) -> Array:
        """Added mass (6, 6) about the center of mass [kg, kg m, kg m^2]; rows: force, columns: acceleration."""
        matrix = np.diag(np.array(self.hydrodynamics.added_mass))
        if self.hydrodynamics.added_mass_cross:
            cross = np.array(self.hydrodynamics.added_mass_cross)
            matrix += cross - np.diag(np.diag(cross))
        return matrix


def unit_of(motion: str, name: str) -> str:
    """Unit of a coefficient of a motion, or of an axis in both directions; HindraxError for another name."""
    if motion not in AXES and motion not in MOTIONS:
        known = ", ".join(dict.fromkeys((*AXES, *MOTIONS)))
        raise HindraxError(f"found the motion {motion!r} in the results, wanted some of {known}; correct its name")
    return coefficient_units(AXES.index(motion) if motion in AXES else MOTIONS[motion].axis)[name]


def mean_of_directions(drag: Drag) -> tuple[float, float]:
    """Quadratic and linear coefficient halfway between both directions, for formats that have one for both."""
    forward, backward = drag.of(backward=False), drag.of(backward=True)
    return 0.5 * (forward[0] + backward[0]), 0.5 * (forward[1] + backward[1])


def _joined(notes: Sequence[str]) -> list[str]:
    """One note for several axes: `sway, heave: not in the results`."""
    axes: dict[str, list[str]] = {}
    for note in notes:
        axis, _, text = note.partition(": ")
        if axis in AXES:
            axes.setdefault(text, []).append(axis)
        else:
            axes[note] = []
    return [": ".join(filter(None, (", ".join(names), text))) for text, names in axes.items()]


def _uncertainty_notes(motions: Mapping[str, MotionResult]) -> Iterator[str]:
    """Uncertainty of each motion including calibration; the formats have no field for it."""
    for name, motion in motions.items():
        known = {key: motion.coefficients[key] for key in TABULATED if key in motion.coefficients and key != "b"}
        words = ", ".join(
            f"{key} {measured(*number.quoted)} {unit_of(name, key)}"
            for key, number in known.items()
            if number.quoted[1] > 0.0
        )
        if words:
            yield f"{name}: {words} ({PLUS_MINUS}, with calibration)"


def identified(saved: SavedCoefficients) -> dict[str, MotionResult]:
    """Results of the motions that were identified."""
    return {name: motion for name, motion in saved.motions.items() if motion.identifiable}


def abort_notes(saved: SavedCoefficients) -> list[str]:
    """Note on a flight that was aborted, if it was."""
    aborted = saved.conditions.aborted
    return [f"aborted by {aborted}; the results are of the part flown until then"] if aborted else []


def assumption_notes(saved: SavedCoefficients) -> list[str]:
    """Notes on what was assumed of the record; the two dozen sizes of a mock's world stay with the results."""
    world = f"{MOCK_WORLD}; its sizes stand in the coefficients"
    return [f"assumed: {world if one.startswith(MOCK_WORLD) else one}" for one in saved.conditions.assumptions]


def export_model(saved: SavedCoefficients, vehicle: Vehicle, source: str, *, complete: bool = False) -> ExportModel:
    """Make an export model of the results of a file.

    A negative drag coefficient, which would drive a simulated vehicle, is folded into the other one at the same force
    at the largest tested speed.

    Parameters
    ----------
    saved
        Results.
    vehicle
        Hull, thrusters and water.
    source
        Name of the file, for notes and errors.
    complete
        Whether missing results come from the vehicle file, with a note.

    Returns
    -------
    ExportModel
        In SNAME axes about the center of mass, SI.

    Raises
    ------
    HindraxError
        Where results are missing, or none are there at all.
    """
    motions = identified(saved)
    lost = {name: motion for name, motion in saved.motions.items() if not motion.identifiable}
    unidentified = {name: next(iter(motion.reasons), "no reason given") for name, motion in lost.items()}
    notes = abort_notes(saved)
    if notes and not motions and not complete:
        raise HindraxError(f"{source}: {notes[0]}, and no motion of that is identifiable; fly it again")
    prior = vehicle.hydrodynamics if complete else None
    # Pool tests reach one radian per second.
    tops, drags = [vehicle.limits.speed_mps] * 3 + [1.0] * 3, {}
    sides = {axis: _sides(axis, motions) for axis in AXES}
    for index, axis in enumerate(AXES):
        tested = [abs(speed) for side in sides[axis] if side for speed in side.speeds]
        tops[index] = max(tested, default=0.0) or tops[index]
        drags[axis] = _axis_drag(axis, sides[axis], prior, tops[index], notes, unidentified=unidentified)
    masses = [_axis_added_mass(axis, sides[axis], prior, notes) for axis in AXES]
    cross = prior.added_mass_cross if prior else ()
    hydrodynamics = Hydrodynamics(added_mass=cast("Vec6", tuple(masses)), added_mass_cross=cross, **drags)
    X, Y, Z, K, M, N = (_axis_across(axis, sides[axis], notes) for axis in AXES)
    notes = [*_joined(notes), *_uncertainty_notes(motions), *assumption_notes(saved)]
    highest, across = cast("Vec6", tuple(tops)), (X, Y, Z, K, M, N)
    return ExportModel(vehicle, hydrodynamics, highest, source, tuple(notes), across)


def unidentified_model(vehicle: Vehicle, source: str) -> ExportModel:
    """Make an export model of a vehicle file alone: to try a tool against numbers that one has put in oneself.

    Parameters
    ----------
    vehicle
        With hydrodynamics.
    source
        Name of the file, for notes.

    Returns
    -------
    ExportModel
        In SNAME axes about the center of mass, SI.

    Raises
    ------
    HindraxError
        When the file has no hydrodynamics.
    """
    if vehicle.hydrodynamics is None:
        remedy = f"`./hindrax estimate --vehicle {source}` prints a block to add"
        raise HindraxError(f"{source}: has no hydrodynamics, wanted some, or results of a run; {remedy}")
    top: Vec6 = (vehicle.limits.speed_mps,) * 3 + (1.0,) * 3
    note = "drag and added mass come from the vehicle file: nobody has identified them"
    return ExportModel(vehicle, vehicle.hydrodynamics, top, source, (note,))


Sides: TypeAlias = Sequence[MotionResult | None]


def _sides(axis: str, motions: Mapping[str, MotionResult]) -> Sides:
    """Results of an axis: one for both directions, or one for each, in heave that of the positive one, down, first."""
    one_each = [motions.get("heave_down"), motions.get("heave_up")]
    return one_each if axis == "heave" and any(one_each) else [motions.get(axis)]


def _axis_drag(
    axis: str,
    sides: Sides,
    prior: Hydrodynamics | None,
    top: float,
    notes: list[str],
    *,
    unidentified: Mapping[str, str],
) -> Drag:
    flown = [side for side in sides if side]
    reason = next((why for name, why in unidentified.items() if name.startswith(axis)), "")
    if not flown:
        if prior is None:
            lacking = f"motion {axis} is not identifiable ({reason})" if reason else f"no motion {axis} in the results"
            raise HindraxError(
                f"{lacking}; name a --vehicle FILE that has hydrodynamics for it (`./hindrax estimate` gives some)"
            )
        why = f"not identifiable in the results ({reason})" if reason else "not in the results"
        notes.append(f"{axis}: {why}; drag and added mass are from the vehicle file")
        return prior.drag(axis)
    if len(flown) < len(sides):
        one_way = f"only one direction is identifiable ({reason})" if reason else "only one direction was tested"
        notes.append(f"{axis}: {one_way}, the other is taken to be the same")
    return Drag(*(k for side in flown for k in _passive(side, axis, top, notes)))


def _passive(motion: MotionResult, axis: str, top: float, notes: list[str]) -> tuple[float, float]:
    k_q, k_l = motion.quoted("k_q"), motion.quoted("k_l")
    if math.isnan(k_q) or math.isnan(k_l):
        raise HindraxError(f"motion {axis}: k_q or k_l is missing; identify it again, or leave the motion out")
    if k_q < 0.0 and k_l < 0.0:
        raise HindraxError(
            f"motion {axis}: k_q = {k_q:.3g} and k_l = {k_l:.3g} both drive the vehicle; identify it again"
        )
    at = f"{top:.3g} {axis_units(AXES.index(axis))[0]}"
    if k_l < 0.0:
        notes.append(f"{axis}: k_l = {k_l:.3g} would drive the vehicle at rest; folded into k_q at {at}")
        return max(0.0, k_q + k_l / top), 0.0
    if k_q < 0.0:
        notes.append(f"{axis}: k_q = {k_q:.3g} would drive a fast vehicle; folded into k_l at {at}")
        return 0.0, max(0.0, k_l + k_q * top)
    return k_q, k_l


def _axis_across(axis: str, sides: Sides, notes: list[str]) -> float:
    found = [side.coefficients["k_w"].quoted[0] for side in sides if side and "k_w" in side.coefficients]
    if not found:
        return 0.0
    if found[0] < 0.0:
        notes.append(f"{axis}: drag by the speed across, k_w = {found[0]:.3g}, would drive the vehicle; taken as zero")
        return 0.0
    notes.append(f"{axis}: the drag by the speed across, k_w, is in the Python and the MuJoCo model only")
    return found[0]


def _axis_added_mass(axis: str, sides: Sides, prior: Hydrodynamics | None, notes: list[str]) -> float:
    found = [side.coefficients["added_mass"] for side in sides if side and "added_mass" in side.coefficients]
    if not found:
        if prior is None:
            raise HindraxError(f"motion {axis}: no added mass in the results; add --vehicle FILE to take it from there")
        if any(sides):
            notes.append(f"{axis}: added mass is not in the results but from the vehicle file")
        return prior.added_mass[AXES.index(axis)]
    weights = [one.std**-2 if all(one.std > 0.0 for one in found) else 1.0 for one in found]
    mass = float(np.average([one.quoted[0] for one in found], weights=weights))
    if mass < 0.0:
        notes.append(f"{axis}: added mass {mass:.3g} is below zero, taken as zero")
    return max(0.0, mass)


def header(model: ExportModel, conventions: tuple[str, ...]) -> list[str]:
    """Header lines of every format: source, reference point, sign conventions, assumptions; 80 wide as a comment."""
    x, y, z = model.vehicle.center_of_mass_m
    lines = [
        f"Hydrodynamics of {model.vehicle.name}, exported by hindrax from {model.source}.",
        (
            "Reference point of drag, added mass and wrench: the center of mass, which lies at"
            f" ({x:.4g}, {y:.4g}, {z:.4g}) m (forward, starboard, down) from the body origin of the vehicle file."
        ),
    ]
    said = [*lines, *conventions, *(f"Note: {note}." for note in model.notes)]
    broken = partial(wrap, width=78, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)
    return [line for one in said for line in broken(one)]


def buoyancy_box_m(vehicle: Vehicle) -> tuple[float, float, float]:
    """Edges of a box with the envelope's shape and the vehicle's volume [m]."""
    L, W, H = vehicle.envelope_m
    scale = math.cbrt(vehicle.volume_m3 / (L * W * H))
    return scale * L, scale * W, scale * H


LOWEST_SHARE = 0.25
"""Drag is fitted and judged from this fraction of the tested speed upwards: a sixteenth of its largest force."""


def tested_speeds(top: float) -> Array:
    """Speeds (16,) over which a format with another drag law is fitted, evenly up to the largest tested one."""
    return array(np.linspace(LOWEST_SHARE, 1.0, 16) * top)


def law_of(k_q: float, k_l: float) -> Callable[[Array], Array]:
    """Force (n,) [N, N m] of a drag over the speed (n,), one direction."""
    return lambda speed: np.asarray((k_q * speed + k_l) * speed)


def terminal_misfit(wanted: Callable[[Array], Array], given: Callable[[Array], Array], top: float) -> float:
    """Largest relative error of the speed at which a thrust is met, over the tested speeds.

    Parameters
    ----------
    wanted, given : (n,) to (n,) [m/s, rad/s] to [N, N m]
        Drag by the result, and as the tool can have it.
    top : [m/s, rad/s]
        Largest tested speed.

    Returns
    -------
    float
        [-].
    """
    speed = tested_speeds(top)
    thrust = wanted(speed)
    if not np.any(thrust):
        return 0.0
    fine = array(np.linspace(0.0, 4.0 * top, 4001))
    reached = np.interp(thrust, given(fine), fine)
    return float(np.max(np.abs(reached / speed - 1.0)))


def thrust_range_N(vehicle: Vehicle, thruster: Thruster) -> tuple[float, float]:
    """Weakest (most negative) and strongest steady thrust of a thruster at the vehicle's supply voltage [N]."""
    curve = vehicle.curves[thruster.curve]
    return running(curve, vehicle.supply_V).range_N


# ---- the little XML that three formats share


def numbers(*values: float) -> str:
    """Shortest texts with nine significant digits, side by side, and never -0."""
    return " ".join(f"{value + 0.0:.9g}" for value in values)


def add(parent: ET.Element, name: str, text: str) -> ET.Element:
    """Append a child element that holds a text.

    Parameters
    ----------
    parent
        Element.
    name, text
        Of the child.

    Returns
    -------
    ET.Element
        The child.
    """
    child = ET.SubElement(parent, name)
    child.text = text
    return child


def commented(root: ET.Element, model: ExportModel, conventions: tuple[str, ...]) -> str:
    """XML text with its declaration, and the header lines as a comment in front.

    Parameters
    ----------
    root
        Element; it is indented in place.
    model
        Whose header lines they are.
    conventions
        Further lines.

    Returns
    -------
    str
        XML.
    """
    ET.indent(root)
    # Two hyphens would end the comment early.
    body = "\n".join(f"  {line.replace('--', '- -')}" for line in header(model, conventions))
    return f'<?xml version="1.0"?>\n<!--\n{body}\n-->\n{ET.tostring(root, encoding="unicode")}\n'
