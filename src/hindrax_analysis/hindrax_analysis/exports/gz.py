"""Gazebo: a model for gz-sim 8 (Harmonic) and later, with the Hydrodynamics system.

Signs. The system adds Fossen's derivatives as they stand: the force is `xU u + xUabsU |u| u`, so damping that resists
is negative. Added mass goes, positive, into `<inertial><fluid_added_mass>` (SDFormat 1.10), where the DART engine
solves it together with the mass and brings its Coriolis terms. The system's own `xDotU`, which is negative and uses the
acceleration of the previous step, diverges when the added mass is larger than the mass (gz-sim issue 1923); it is
written only when asked for. Both at once would count it twice.

Axes. Gazebo's body axes are x forward, y left, z up: SNAME turned half around x. A diagonal of drag is the same in
both; added mass off the diagonal changes sign where one of its two axes is turned. Up and down are exchanged: what
differs between them goes into `zWW w^2`, which is exact for the quadratic part; the linear part is the mean of both.
"""

from typing import Literal
from xml.etree import ElementTree as ET

import numpy as np

from hindrax_analysis.exports.export_model import (
    ExportModel,
    add,
    buoyancy_box_m,
    commented,
    mean_of_directions,
    numbers,
)
from hindrax_core.vehicle import AXES
from hindrax_ident.arrays import Array

TURN = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
"""SNAME to Gazebo body axes, for velocities, forces, rates and moments alike."""

LINK = "base_link"
FORCES, VELOCITIES, MASS_LETTERS = "xyzkmn", "UVWPQR", "xyzpqr"

CONVENTIONS = (
    "For gz-sim 8 (Harmonic) and later. Body axes x forward, y left, z up.",
    "Damping is negative (force = xU u + xUabsU |u| u); added mass is positive in fluid_added_mass.",
    "The world needs the Physics and Buoyancy systems; the collision box displaces the vehicle's volume.",
)


def write(model: ExportModel, added_mass: Literal["inertial", "plugin"] = "inertial") -> str:
    """SDF text of a complete model."""
    sdf = ET.Element("sdf", version="1.10")
    body = ET.SubElement(sdf, "model", name=model.vehicle.name)
    base = ET.SubElement(body, "link", name=LINK)
    _inertial(base, model, with_fluid=added_mass == "inertial")
    collision = ET.SubElement(base, "collision", name="displaced_volume")
    add(collision, "pose", _pose(model.vehicle.center_of_buoyancy_m))
    box = ET.SubElement(ET.SubElement(collision, "geometry"), "box")
    add(box, "size", numbers(*buoyancy_box_m(model.vehicle)))
    plugin = ET.SubElement(
        body, "plugin", filename="gz-sim-hydrodynamics-system", name="gz::sim::systems::Hydrodynamics"
    )
    add(plugin, "link_name", LINK)
    add(plugin, "water_density", numbers(model.vehicle.water.density_kgpm3))
    _damping(plugin, model)
    lost: tuple[str, ...] = ()
    if added_mass == "plugin":
        matrix = to_gazebo_axes(model.added_mass)
        for row, column in zip(*np.nonzero(matrix), strict=True):
            add(plugin, f"{FORCES[row]}Dot{VELOCITIES[column]}", numbers(-matrix[row, column]))
    elif not np.allclose(model.added_mass, model.added_mass.T):
        lost = ("fluid_added_mass is symmetric by definition: the mean of each pair of cross terms is written.",)
    return commented(sdf, model, CONVENTIONS + lost)


def _damping(plugin: ET.Element, model: ExportModel) -> None:
    for index, axis in enumerate(AXES):
        drag = model.hydrodynamics.drag(axis)
        k_q, k_l = mean_of_directions(drag)
        force, velocity = FORCES[index], VELOCITIES[index]
        add(plugin, f"{force}{velocity}", numbers(-k_l))
        add(plugin, f"{force}{velocity}abs{velocity}", numbers(-k_q))
        forward, backward = drag.of(backward=False)[0], drag.of(backward=True)[0]
        if forward != backward:
            # Gazebo's forward is SNAME's forward or backward: the half difference takes the sign of the turn.
            add(plugin, f"{force}{velocity}{velocity}", numbers(-0.5 * (forward - backward) * TURN[index]))


def to_gazebo_axes(matrix: Array) -> Array:
    """Added mass (6, 6) [kg, kg m, kg m^2] from SNAME to Gazebo axes; its own inverse."""
    return np.asarray(matrix * np.outer(TURN, TURN))


def _moved_to(matrix: Array, point_m: tuple[float, float, float]) -> Array:
    """Symmetric part of an added mass (6, 6) about the body origin, transferred to another point."""
    x, y, z = point_m
    carry = np.eye(6)
    carry[:3, 3:] = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(carry.T @ (0.5 * (matrix + matrix.T)) @ carry)


def _inertial(link: ET.Element, model: ExportModel, *, with_fluid: bool) -> None:
    inertial = ET.SubElement(link, "inertial")
    add(inertial, "pose", _pose(model.vehicle.center_of_mass_m))
    add(inertial, "mass", numbers(model.vehicle.mass_kg))
    inertia = ET.SubElement(inertial, "inertia")
    for name, moment in zip(("ixx", "iyy", "izz"), model.vehicle.inertia, strict=True):
        add(inertia, name, numbers(moment))
    for name in ("ixy", "ixz", "iyz"):
        add(inertia, name, "0")
    if with_fluid:
        fluid = ET.SubElement(inertial, "fluid_added_mass")
        matrix = to_gazebo_axes(_moved_to(model.added_mass, model.vehicle.center_of_mass_m))
        for row, column in zip(*np.triu_indices(6), strict=True):
            add(fluid, f"{MASS_LETTERS[row]}{MASS_LETTERS[column]}", numbers(matrix[row, column]))


def _pose(position_m: tuple[float, float, float]) -> str:
    x, y, z = position_m
    return numbers(x, -y, -z, 0.0, 0.0, 0.0)
