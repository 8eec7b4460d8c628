"""Added mass, drag and inertia of an open-frame vehicle from its dimensions. Eidsvik 2015, chapter 3 and appendix A.

A prior for the estimators and a sanity check of their results. The projected areas matter most: added mass goes with
about the fourth power of how full the box is, so without them the estimate is an upper bound, and is marked so.
Axes are SNAME (x forward, y starboard, z down); six-vectors go surge, sway, heave, roll, pitch, yaw.
"""

import math
from dataclasses import dataclass
from typing import cast

import numpy as np
from scipy.interpolate import CubicSpline

from hindrax_core.errors import HindraxError
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Vec6
from hindrax_core.vehicle import Drag, Hydrodynamics

PRISM_RATIO = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0)
PRISM_ADDED_MASS = (0.68, 0.36, 0.24, 0.19, 0.15, 0.14, 0.11)
"""Square prism along its axis, DNV-RP-H103. The text prints 0.13 at 6; the script, and its results, have 0.14."""

SECTION_RATIO = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0)
SECTION_ADDED_MASS = (2.23, 1.98, 1.7, 1.51, 1.36, 1.21, 1.14)
SECTION_ADDED_INERTIA = (0.147, 0.15, 0.15, 0.234, 0.15, 0.15, 0.125)
"""Rectangular section, width over height, translation and rotation, DNV-RP-H103."""

SECTION_DRAG_RATIO = (0.5, 1.5, 2.5, 6.0)
SECTION_DRAG = (2.5, 1.8, 1.4, 0.89)
BODY_DRAG_RATIO = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0)
BODY_DRAG = (1.25, 1.25, 1.15, 0.97, 0.87, 0.90, 0.93, 0.95, 0.95)
"""Depth along the flow over width across it, two and three dimensions, Blevins."""

LINEAR_PART = 0.16
"""Linear over quadratic coefficient in translation, numerically in SI."""

ROTATION_DAMPING_RATIO = 0.025
"""Damping ratio of the roll and pitch oscillation that gives their linear drag."""

AREAS_ASSUMED = "projected areas not given: full boxes assumed, so added mass and drag are upper bounds"


@dataclass(frozen=True, slots=True)
class Dimensions:
    """Envelope, projected areas (None: a full box), mass and the arm from center of mass up to center of buoyancy."""

    length_m: float
    width_m: float
    height_m: float
    mass_kg: float
    front_m2: float | None = None
    side_m2: float | None = None
    top_m2: float | None = None
    density_kgpm3: float = 1000.0
    buoyancy_arm_m: float = 0.0
    prism_added_mass: tuple[float, ...] = PRISM_ADDED_MASS

    def __post_init__(self) -> None:
        """HindraxError for sizes that are not positive, and for projections larger than their box."""
        for name in ("length_m", "width_m", "height_m", "mass_kg", "density_kgpm3"):
            if not getattr(self, name) > 0.0:
                raise HindraxError(f"estimate: {name} is {getattr(self, name)}, wanted more than 0")
        for name, ratio in zip(("front_m2", "side_m2", "top_m2"), self.area_ratios, strict=True):
            if not 0.0 < ratio <= 1.0 + 1e-9:
                raise HindraxError(f"estimate: {name} is {ratio:.3g} of its box, wanted more than 0 and at most 1")

    @property
    def area_ratios(self) -> tuple[float, float, float]:
        """Projected areas seen along x, y and z over the box's: Cp_YZ, Cp_XZ, Cp_XY."""
        L, W, H = self.length_m, self.width_m, self.height_m
        pairs = ((self.front_m2, H * W), (self.side_m2, L * H), (self.top_m2, L * W))
        x, y, z = (1.0 if area is None else area / box for area, box in pairs)
        return (x, y, z)


@dataclass(frozen=True, slots=True)
class EmpiricalModel:
    """The estimate. Added mass [kg, kg m^2], drag [N s^2/m^2, N m s^2] and [N s/m, N m s], inertia [kg m^2]."""

    added_mass: Vec6
    quadratic_drag: Vec6
    linear_drag: Vec6
    inertia_kgm2: tuple[float, float, float]
    restoring_Nm: float
    """m g BG: the righting moment per sine of roll or pitch."""
    scale_added_mass: float
    """lambda, from strips to three dimensions."""
    scale_drag: float
    """lambda, from two dimensions to three."""
    notes: tuple[str, ...]
    """Assumptions: areas not given, ratios beyond their table."""


class _Table:
    """A cubic spline through tabulated points, constant beyond its ends, that notes evaluations there."""

    def __init__(self, name: str, ratios: tuple[float, ...], values: tuple[float, ...], notes: list[str]) -> None:
        self._name, self._low, self._high, self._notes = name, ratios[0], ratios[-1], notes
        self._spline = CubicSpline(np.array(ratios), np.array(values))

    def __call__(self, ratio: float) -> float:
        held = min(max(ratio, self._low), self._high)
        if not math.isclose(held, ratio, rel_tol=1e-9):
            self._notes.append(f"{self._name}: ratio {ratio:.3g} taken as {held:g}, the end of its table")
        return float(self._spline(held))


def empirical(dimensions: Dimensions) -> EmpiricalModel:
    """Empirical model from the dimensions. Eidsvik 2015 chapter 3, with the script of its appendix A."""
    given = (dimensions.front_m2, dimensions.side_m2, dimensions.top_m2)
    notes = [AREAS_ASSUMED] if None in given else []
    added, scale_added = _added_mass(dimensions, notes)
    quadratic, scale_drag = _quadratic_drag(dimensions, notes)
    # A homogeneous prism. Eidsvik 2015 eq. 3.1.
    twelfth = dimensions.mass_kg / 12.0
    L, W, H = (size**2 for size in (dimensions.length_m, dimensions.width_m, dimensions.height_m))
    inertia = (twelfth * (W + H), twelfth * (L + H), twelfth * (W + L))
    restoring = dimensions.mass_kg * GRAVITY_mps2 * dimensions.buoyancy_arm_m
    return EmpiricalModel(
        added_mass=added,
        quadratic_drag=quadratic,
        linear_drag=_linear_drag(quadratic, added, inertia, restoring),
        inertia_kgm2=inertia,
        restoring_Nm=restoring,
        scale_added_mass=scale_added,
        scale_drag=scale_drag,
        notes=tuple(dict.fromkeys(notes)),
    )


def hydrodynamics_of(model: EmpiricalModel) -> Hydrodynamics:
    """Return the estimate as the block of a vehicle file, with the digits that it deserves."""
    tables = (model.added_mass, model.quadratic_drag, model.linear_drag)
    added, k_q, k_l = ([float(f"{one:.3g}") for one in row] for row in tables)
    surge, sway, heave, roll, pitch, yaw = map(Drag, k_q, k_l)
    return Hydrodynamics(cast("Vec6", tuple(added)), surge, sway, heave, roll, pitch, yaw)


def _added_mass(dimensions: Dimensions, notes: list[str]) -> tuple[Vec6, float]:
    """Strips of rectangular section, carried to three dimensions by the ratio found in surge."""
    L, W, H, rho = dimensions.length_m, dimensions.width_m, dimensions.height_m, dimensions.density_kgpm3
    front, side, top = dimensions.area_ratios
    filled = front * side * top
    prism = _Table("added mass of a prism", PRISM_RATIO, dimensions.prism_added_mass, notes)
    section = _Table("added mass of a section", SECTION_RATIO, SECTION_ADDED_MASS, notes)
    turned = _Table("added inertia of a section", SECTION_RATIO, SECTION_ADDED_INERTIA, notes)
    across = 0.5 * (H + W)
    surge_3d = prism(L / across) * L * across**2 * rho * filled * front
    surge_strip = rho * section(W / L) * math.pi * (0.5 * W) ** 2 * filled * front * H
    scale = math.sqrt(surge_3d / surge_strip)
    lateral = rho * section(L / W) * math.pi * (0.5 * L) ** 2 * filled

    def rotation(ratio: float, largest: float, along: float) -> float:
        return rho * turned(ratio) * math.pi * (0.5 * largest) ** 4 * filled * along

    strips = (surge_strip, lateral * side * H, lateral * top * W)
    turns = (rotation(H / W, max(H, W), L), rotation(L / H, max(L, H), W), rotation(W / L, max(L, W), H))
    return cast("Vec6", tuple(scale * value for value in (*strips, *turns))), scale


def _quadratic_drag(dimensions: Dimensions, notes: list[str]) -> tuple[Vec6, float]:
    """Two-dimensional drag of each face, carried to three dimensions by the ratio found in surge.

    A rotation meets four quarters of faces; each is a plate with a third of the drag (the speed grows from the axis
    outwards) at three quarters of the half length, and its depth counts against the half length.
    """
    L, W, H, rho = dimensions.length_m, dimensions.width_m, dimensions.height_m, dimensions.density_kgpm3
    part_x, part_y, part_z = dimensions.area_ratios
    front, side, top = part_x * H * W, part_y * L * H, part_z * L * W
    section = _Table("drag of a section", SECTION_DRAG_RATIO, SECTION_DRAG, notes)
    body = _Table("drag of a body", BODY_DRAG_RATIO, BODY_DRAG, notes)
    across = 0.5 * (H + W)
    scale = body(L / across) / section(L / W)

    def face(ratio: float, area: float) -> float:
        return 0.5 * rho * section(ratio) * area * scale

    def quarters(depth: float, size: float, area: float) -> float:
        return face(depth / (0.5 * size), area) / 3.0 * 0.75 * (0.5 * size) ** 3

    return (
        face(L / across, front),
        face(W / H, side),
        face(H / W, top),
        quarters(H, W, top) + quarters(W, H, side),
        quarters(H, L, top) + quarters(L, H, front),
        quarters(W, L, side) + quarters(L, W, front),
    ), scale


def _linear_drag(quadratic: Vec6, added: Vec6, inertia: tuple[float, float, float], restoring: float) -> Vec6:
    """Translations as a part of the quadratic; roll and pitch from their damping ratio; yaw by the ratio of pitch."""
    roll, pitch = (
        2.0 * ROTATION_DAMPING_RATIO * math.sqrt(restoring * (inertia[axis] + added[axis + 3])) for axis in (0, 1)
    )
    surge, sway, heave = (LINEAR_PART * quadratic[axis] for axis in range(3))
    return (surge, sway, heave, roll, pitch, quadratic[5] * pitch / quadratic[4])
