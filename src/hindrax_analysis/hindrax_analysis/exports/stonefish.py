"""Stonefish: a dynamic body for a scenario file.

Stonefish computes drag from the faces of the body, and takes three quadratic and three viscous coefficients, all
positive. Along an axis of a box the force is 1/2 rho C_d A |u|^n u on the face that meets the water and rho C_f S u on
the faces along it (A, S: their areas; C_f in m/s). The library's drag has n = 2, a cube of the speed in all, since
February 2024 (version 1.4 and later); before, n = 1. With the cube no coefficient reproduces a quadratic drag at every
speed: both are fitted to it over the tested speeds, and the comment states the error. Added mass and the drag of
rotation follow from the geometry and cannot be given.
"""

from typing import Literal, TypeAlias
from xml.etree import ElementTree as ET

import numpy as np
from scipy.optimize import nnls

from hindrax_analysis.exports.export_model import ExportModel, buoyancy_box_m, commented, mean_of_directions, numbers
from hindrax_analysis.exports.uuv import one_sided_notes
from hindrax_core.vehicle import AXES

Law: TypeAlias = Literal["cubic", "quadratic"]

CONVENTIONS = (
    "For a Stonefish scenario file, axes x forward, y right, z down. All coefficients are positive.",
    "The box displaces the vehicle's volume; materials Hull and look Hull are yours to define.",
    "Added mass and the drag of rotation are computed by Stonefish from the box and cannot be given.",
)


def write(model: ExportModel, law: Law = "cubic") -> str:
    """XML text of the dynamic element."""
    vehicle = model.vehicle
    body = ET.Element("dynamic", name=vehicle.name, type="box", physics="submerged", buoyant="true")
    ET.SubElement(body, "dimensions", xyz=numbers(*buoyancy_box_m(vehicle)))
    ET.SubElement(body, "origin", xyz=numbers(*vehicle.center_of_buoyancy_m), rpy="0 0 0")
    ET.SubElement(body, "material", name="Hull")
    ET.SubElement(body, "look", name="Hull")
    ET.SubElement(body, "mass", value=numbers(vehicle.mass_kg))
    ET.SubElement(body, "inertia", xyz=numbers(*vehicle.inertia))
    ET.SubElement(body, "cg", xyz=numbers(*vehicle.center_of_mass_m), rpy="0 0 0")
    fits = [coefficients(model, axis, law) for axis in range(3)]
    c_d, c_f, misfits = zip(*fits, strict=True)
    ET.SubElement(body, "hydrodynamics", viscous_drag=numbers(*c_f), quadratic_drag=numbers(*c_d))
    ET.SubElement(body, "world_transform", xyz="0 0 1", rpy="0 0 0")
    quality = tuple(
        f"{axis}: within {100.0 * misfit:.1f} % of the force at {top:.3g} m/s from 0 to there ({law} law)."
        for axis, misfit, top in zip(AXES, misfits, model.top_speed, strict=False)
    )
    return commented(body, model, CONVENTIONS + one_sided_notes(model) + quality)


def coefficients(model: ExportModel, axis: int, law: Law) -> tuple[float, float, float]:
    """C_d [-, with the cube s/m], C_f [m/s] and the largest misfit as a part of the force at the top speed."""
    edges = np.array(buoyancy_box_m(model.vehicle))
    others = np.delete(edges, axis)
    front = float(np.prod(others))
    along = 2.0 * float(edges[axis] * np.sum(others))
    rho = model.vehicle.water.density_kgpm3
    k_q, k_l = mean_of_directions(model.hydrodynamics.drag(AXES[axis]))
    speed = np.linspace(0.0, model.top_speed[axis], 101)
    wanted = k_q * speed**2 + k_l * speed
    power = 3 if law == "cubic" else 2
    columns = np.column_stack((0.5 * rho * front * speed**power, rho * along * speed))
    scale = np.linalg.norm(columns, axis=0)
    scaled, _ = nnls(columns / scale, wanted)
    c_d, c_f = (float(value) for value in scaled / scale)
    misfit = float(np.max(np.abs(columns @ np.array([c_d, c_f]) - wanted))) / float(wanted[-1] or 1.0)
    return c_d, c_f, misfit
