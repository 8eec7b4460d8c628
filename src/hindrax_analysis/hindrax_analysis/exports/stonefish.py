"""Stonefish: a dynamic body for a scenario file, of parts, so that each of its laws can be met.

What Stonefish does with a body (its public source, SolidEntity and Compound). Drag is summed over the faces of every
external part: along an axis of a box it is 1/2 rho C_d A |u|^n u on the face that meets the water, and rho C_f S u on
the faces along it (A, S: their areas; C_f in m/s); a turning box meets the water with the same faces, so its moment
follows from edges and coefficients. The library's drag has n = 2, a cube of the speed in all, since February 2024
(version 1.4 and later); before, n = 1. Added mass follows from the shape of parts that are `submerged`; a free body is
then moved with the mean of its three values, and with the moments of inertia that the file gives.

So one part does one thing. An *internal* box displaces the volume and carries mass and inertia, the added one included:
weight, buoyancy and righting moment are exact. Two external boxes at the center of mass, `floating` and not buoyant,
have the drag and nothing else: a small one that of motion, a large one that of turning. An external sphere at the
center of mass without drag has the added mass: one number for three axes, so the acceleration of at least two of them
is wrong by what the header states. A sphere has 2/3 pi rho r^3 (Lamb), but every Stonefish from 0.9 to 1.6 computes
2/3 pi rho r^6 (`ComputeSphericalApprox` cubes the square of the radius): seen as a vehicle that gathers speed in half
the time. The radius is that of the engine as it is. With the cube no coefficient reproduces a quadratic drag at every
speed: that misfit is stated, too.
"""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias
from xml.etree import ElementTree as ET

import numpy as np

from hindrax_analysis.exports.export_model import (
    LOWEST_SHARE,
    ExportModel,
    buoyancy_box_m,
    commented,
    law_of,
    mean_of_directions,
    numbers,
    terminal_misfit,
    tested_speeds,
)
from hindrax_analysis.exports.uuv import one_sided_notes
from hindrax_core.readings import Vec3
from hindrax_core.vehicle import AXES, Vehicle
from hindrax_ident.arrays import Array

Law: TypeAlias = Literal["cubic", "quadratic"]

WEIGHTLESS_kg = 1e-3
"""Mass of a part that has none: Stonefish wants one, and computes it from the volume where it is missing."""
SPHERE_POWER = 6
"""Of the radius, in the added mass of a sphere: by theory 3."""
FORCE_BOX, ROUNDS = 0.15, 4
"""Edges of the box of the forces over those of the envelope."""
MOMENT_BOX = (0.75, 1.0, 1.25, 1.5, 2.0, 2.5, 3.0)
"""Edges of the box of the moments over those of the envelope, the smallest first."""
LARGEST_PART = 0.2
"""Part of any force that the box of the moments may have, where a size allows."""

CONVENTIONS = (
    "For a Stonefish scenario file, axes x forward, y right, z down. All coefficients are positive.",
    "Materials and looks Hull and Water are yours to define; Water is not to be shown.",
    "Internal part: mass, inertia with the added one, buoyancy. External boxes: drag. External sphere: added mass.",
)

ACROSS = (
    "These speeds are of motion along one axis alone: in Stonefish a drag across adds to that along, newtons to"
    " newtons. Trim the vehicle, or hold its depth."
)
"""It weighs the raw force F of a part, as a whole, by the sum of |F_i| C_i over |F|."""


def write(model: ExportModel, law: Law = "cubic") -> str:
    """XML text of the dynamic element."""
    boxes = drag_boxes(model, law)
    body = ET.Element("dynamic", name=model.vehicle.name, type="compound", physics="submerged", buoyant="true")
    parts(body, model, boxes)
    ET.SubElement(body, "world_transform", xyz="0 0 1", rpy="0 0 0")
    return commented(body, model, CONVENTIONS + notes_of(model, law, boxes))


def parts(body: ET.Element, model: ExportModel, boxes: tuple["DragBox", "DragBox"]) -> None:
    """Fill a compound body: drag, added mass and hull, about the origin of the vehicle file.

    Parameters
    ----------
    body
        Element of the compound; changed in place.
    model
        What it is to do.
    boxes
        Of motion and of turning, by `drag_boxes`.
    """
    for name, box in zip(("drag_of_motion", "drag_of_turning"), boxes, strict=True):
        _drag(body, model, name, box)
    _added_mass(body, model)
    _hull(body, model)


def notes_of(model: ExportModel, law: Law, boxes: tuple["DragBox", "DragBox"]) -> tuple[str, ...]:
    """What Stonefish cannot do with this model, and by how much it errs.

    Parameters
    ----------
    model
        What is wanted.
    law
        How Stonefish makes drag of a box: cubic, or quadratic.
    boxes
        By `drag_boxes`.

    Returns
    -------
    tuple[str, ...]
        Sentences.
    """
    depth_m = whole_from_m(model.vehicle, boxes)
    shallow = (
        f"Shallower than {depth_m:.2g} m the box of turning is partly out of the water: too little drag, and tilt."
    )
    return one_sided_notes(model) + tuple(_quality(model, law, boxes)) + (ACROSS, shallow)


def whole_from_m(vehicle: Vehicle, boxes: tuple["DragBox", "DragBox"]) -> float:
    """Depth of the origin from which on every part of the body is in the water [m]."""
    highest = max(float(box.faces.edges_m[2]) for box in boxes)
    return 0.5 * highest - vehicle.center_of_mass_m[2]


# ---- the parts


def _part(body: ET.Element, kind: str, name: str, shape: str, **attributes: str) -> ET.Element:
    part = ET.SubElement(body, kind, {"name": name, "type": shape, **attributes})
    ET.SubElement(part, "origin", xyz="0 0 0", rpy="0 0 0")
    return part


def _looks(part: ET.Element, name: str, at_m: Vec3) -> None:
    ET.SubElement(part, "material", name=name)
    ET.SubElement(part, "look", name=name)
    ET.SubElement(part, "compound_transform", xyz=numbers(*at_m), rpy="0 0 0")


def _drag(body: ET.Element, model: ExportModel, name: str, box: "DragBox") -> None:
    part = _part(body, "external_part", name, "box", physics="floating", buoyant="false", collisions="false")
    c_d, c_f = box.coefficients.T
    ET.SubElement(part, "dimensions", xyz=numbers(*box.faces.edges_m))
    ET.SubElement(part, "mass", value=numbers(WEIGHTLESS_kg))
    ET.SubElement(part, "inertia", xyz=numbers(*[1e-6] * 3))
    ET.SubElement(part, "hydrodynamics", viscous_drag=numbers(*c_f), quadratic_drag=numbers(*c_d))
    _looks(part, "Water", model.vehicle.center_of_mass_m)


def _added_mass(body: ET.Element, model: ExportModel) -> None:
    part = _part(
        body, "external_part", "added_mass", "sphere", physics="submerged", buoyant="false", collisions="false"
    )
    ET.SubElement(part, "dimensions", radius=numbers(sphere_radius_m(model)))
    ET.SubElement(part, "mass", value=numbers(WEIGHTLESS_kg))
    ET.SubElement(part, "inertia", xyz=numbers(*[1e-6] * 3))
    ET.SubElement(part, "hydrodynamics", viscous_drag="0 0 0", quadratic_drag="0 0 0")
    _looks(part, "Water", model.vehicle.center_of_mass_m)


def _hull(body: ET.Element, model: ExportModel) -> None:
    vehicle = model.vehicle
    part = _part(body, "internal_part", "hull", "box", physics="submerged", buoyant="true", always_visible="true")
    ET.SubElement(part, "dimensions", xyz=numbers(*buoyancy_box_m(vehicle)))
    ET.SubElement(part, "mass", value=numbers(vehicle.mass_kg - 3.0 * WEIGHTLESS_kg))
    added = np.diag(model.added_mass)[3:]
    ET.SubElement(part, "inertia", xyz=numbers(*(np.array(vehicle.inertia) + added)))
    x, y, z = model.buoyancy_arm_m
    ET.SubElement(part, "cg", xyz=numbers(-x, -y, -z), rpy="0 0 0")
    _looks(part, "Hull", vehicle.center_of_buoyancy_m)


def sphere_radius_m(model: ExportModel, power: int = SPHERE_POWER) -> float:
    """Radius [m] of the sphere to which Stonefish gives the common added mass, by 2/3 pi rho r^power."""
    density_kgpm3 = model.vehicle.water.density_kgpm3
    return float((1.5 * common_added_mass(model) / (math.pi * density_kgpm3)) ** (1.0 / power))


def common_added_mass(model: ExportModel) -> float:
    """One added mass [kg] for three axes: the geometric middle of the total masses, so that both ends err alike."""
    totals = model.vehicle.mass_kg + np.diag(model.added_mass)[:3]
    return math.sqrt(float(np.min(totals)) * float(np.max(totals))) - model.vehicle.mass_kg


# ---- the two boxes of drag


class Faces:
    """What the faces of a box do per coefficient, in water of a density: a C_d and a C_f for each axis."""

    def __init__(self, edges_m: Array, density_kgpm3: float, law: Law) -> None:
        self.edges_m = edges_m
        self._rho, self._power = density_kgpm3, 3 if law == "cubic" else 2

    def columns(self, axis: int, speed: Array) -> Array:
        """Force along an axis per C_d and per C_f, or from 3 on moment about it: (n, 2)."""
        front, along = self._sliding(axis) if axis < 3 else self._turning(axis - 3)
        return np.column_stack((0.5 * self._rho * front * speed**self._power, self._rho * along * speed))

    def _sliding(self, axis: int) -> tuple[float, float]:
        others = np.delete(self.edges_m, axis)
        return float(np.prod(others)), 2.0 * float(self.edges_m[axis] * np.sum(others))

    def _turning(self, axis: int) -> tuple[float, float]:
        """What stands for the areas when the box turns: integrals of r^n r_n over the faces that meet the water.

        A point at a distance r from the axis moves with w r; of that w r_n, its distance along the face, is towards the
        face on one half of each of the four faces around the axis. Its drag 1/2 rho C_d |v|^(n-1) v_n v has the arm r.
        """
        length = float(self.edges_m[axis])
        one, two = (0.5 * float(edge) for edge in np.delete(self.edges_m, axis))
        nodes, weights = np.polynomial.legendre.leggauss(12)
        front = 0.0
        for depth, half in ((one, two), (two, one)):
            along_m = 0.5 * half * (nodes + 1.0)
            arm_m = np.hypot(depth, along_m)
            front += 2.0 * length * float(np.sum(0.5 * half * weights * arm_m**self._power * along_m))
        # The faces around the axis slide with w times their depth, the two ends with w r.
        along = 4.0 * length * (one**2 * two + two**2 * one) + 8.0 * one * two * (one**2 + two**2) / 3.0
        return front, along


@dataclass(frozen=True, slots=True)
class DragBox:
    """A box and its coefficients (3, 2): C_d [-, with the cube s/m] and C_f [m/s] of each axis."""

    faces: Faces
    coefficients: Array

    def resistance(self, axis: int, speed: Array) -> Array:
        """Force along an axis, or moment about it, at speeds (n,) [N, N m]."""
        # Stonefish weighs a moment by the coefficient of its axis.
        return np.asarray(self.faces.columns(axis, speed) @ self.coefficients[axis % 3])


def drag_boxes(model: ExportModel, law: Law) -> tuple[DragBox, DragBox]:
    """Box of the forces and box of the moments.

    The moment of a box goes with its edge to the power of five, its force with the square: a small box with large
    coefficients resists motion and hardly turning, a large one the reverse. So six laws are met, each with two
    coefficients of its own. The large box is no larger than leaves the small one something to do.

    Parameters
    ----------
    model
        Drag of six axes.
    law
        How Stonefish makes drag of a box.

    Returns
    -------
    tuple[DragBox, DragBox]
        Edges [m] and coefficients [-].
    """
    vehicle = model.vehicle
    envelope = np.array(vehicle.envelope_m)

    def fitted(scale: float, first_axis: int, other: DragBox | None) -> DragBox:
        faces = Faces(scale * envelope, vehicle.water.density_kgpm3, law)
        return DragBox(faces, np.array([_fit(model, faces, axis + first_axis, other) for axis in range(3)]))

    for scale in MOMENT_BOX:
        turning = fitted(scale, 3, None)
        if all(_part_of_force(model, turning, axis) < LARGEST_PART for axis in range(3)):
            break
    for _ in range(ROUNDS):  # each box then does what the other leaves
        motion = fitted(FORCE_BOX, 0, turning)
        turning = fitted(scale, 3, motion)
    return motion, turning


def _fit(model: ExportModel, faces: Faces, axis: int, other: DragBox | None) -> Array:
    speed = tested_speeds(model.top_speed[axis])
    wanted = _wanted(model, axis)(speed)
    if not np.any(wanted):
        return np.zeros(2)
    missing = wanted - other.resistance(axis, speed) if other else wanted
    # Relative to the whole force: what matters is the speed at which a thrust is met.
    columns = faces.columns(axis, speed) / wanted[:, None]
    scale = np.linalg.norm(columns, axis=0)
    from scipy.optimize import nnls  # noqa: PLC0415  # slow to import

    scaled, _ = nnls(columns / scale, missing / wanted)
    return np.asarray(scaled / scale)


def _part_of_force(model: ExportModel, box: DragBox, axis: int) -> float:
    speed = tested_speeds(model.top_speed[axis])
    return float(np.max(box.resistance(axis, speed) / np.maximum(_wanted(model, axis)(speed), 1e-12)))


def _wanted(model: ExportModel, axis: int) -> Callable[[Array], Array]:
    return law_of(*mean_of_directions(model.hydrodynamics.drag(AXES[axis])))


# ---- what cannot be met


def _quality(model: ExportModel, law: Law, boxes: tuple[DragBox, DragBox]) -> Iterator[str]:
    """Misfit of the terminal speeds, and of the acceleration, axis by axis."""
    for axis, name in enumerate(AXES):

        def given(speed: Array, axis: int = axis) -> Array:
            """Resistance of both boxes, (n,) [N, N m]."""
            return boxes[0].resistance(axis, speed) + boxes[1].resistance(axis, speed)

        top = model.top_speed[axis]
        misfit = terminal_misfit(_wanted(model, axis), given, top)
        yield (
            f"{name}: terminal speeds within {100.0 * misfit:.1f} % from {LOWEST_SHARE * top:.3g} to {top:.3g}"
            f" ({law} law for a quadratic one)."
        )
    common = common_added_mass(model)
    for axis, name in enumerate(AXES[:3]):
        total = model.vehicle.mass_kg + model.added_mass[axis, axis]
        ratio = (model.vehicle.mass_kg + common) / total - 1.0
        yield (
            f"{name}: gathers speed {abs(100.0 * ratio):.0f} % {'slower' if ratio > 0.0 else 'faster'} than identified:"
            " Stonefish moves a free body with one added mass for all three axes."
        )
    yield (
        f"Added mass: Stonefish 0.9 to 1.6 gives a sphere 2/3 pi rho r^{SPHERE_POWER}, as counted on here; a version"
        f" that gives it r^3 needs a radius of {sphere_radius_m(model, 3):.4g} m."
    )
    cross = model.added_mass - np.diag(np.diag(model.added_mass))
    if np.any(cross):
        yield "Added mass off the diagonal cannot be given and is left out."
