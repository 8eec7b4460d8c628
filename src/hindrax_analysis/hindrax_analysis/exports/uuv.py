"""uuv_simulator and its ROS 2 successor Plankton: the underwater object plugin with a Fossen model.

Signs. Its added mass is the matrix M_A itself, positive (force = -M_A a); its damping are derivatives, negative
(D = -linear - quadratic |v|, force = -D v). The plugin turns the velocity into x forward, y right, z down before it
uses either, so matrices are written in SNAME axes; positions are in Gazebo's axes, from the center of mass, where the
origin of the link belongs.
"""

from xml.etree import ElementTree as ET

from hindrax_analysis.exports.export_model import (
    LOWEST_SHARE,
    ExportModel,
    add,
    commented,
    law_of,
    mean_of_directions,
    numbers,
    terminal_misfit,
)
from hindrax_core.vehicle import AXES

CONVENTIONS = (
    "For uuv_simulator and Plankton: put it inside the model (in a URDF, inside a gazebo element).",
    "added_mass: rows of the 6 x 6 matrix, positive. linear_damping, quadratic_damping: diagonals, negative.",
    "Matrices are in x forward, y right, z down, as the plugin uses them; center_of_buoyancy in Gazebo's axes.",
    "Put the origin of base_link at the center of mass: the plugin damps the velocity of the link's origin.",
)

ONE_SIDED = "has one coefficient for both directions here: the mean"


def write(model: ExportModel) -> str:
    """XML text of the plugin element."""
    vehicle = model.vehicle
    plugin = ET.Element("plugin", name="uuv_plugin", filename="libuuv_underwater_object_ros_plugin.so")
    add(plugin, "fluid_density", numbers(vehicle.water.density_kgpm3))
    add(plugin, "flow_velocity_topic", "hydrodynamics/current_velocity")
    body = ET.SubElement(plugin, "link", name="base_link")
    add(body, "neutrally_buoyant", "0")
    add(body, "volume", numbers(vehicle.volume_m3))
    box = ET.SubElement(body, "box")
    for name, edge in zip(("length", "width", "height"), vehicle.envelope_m, strict=True):
        add(box, name, numbers(edge))
    x, y, z = model.buoyancy_arm_m
    add(body, "center_of_buoyancy", numbers(x, -y, -z))
    hydrodynamics = ET.SubElement(body, "hydrodynamic_model")
    add(hydrodynamics, "type", "fossen")
    add(hydrodynamics, "added_mass", numbers(*model.added_mass.ravel()))
    pairs = [mean_of_directions(model.hydrodynamics.drag(axis)) for axis in AXES]
    add(hydrodynamics, "linear_damping", numbers(*(-k_l for _, k_l in pairs)))
    add(hydrodynamics, "quadratic_damping", numbers(*(-k_q for k_q, _ in pairs)))
    return commented(plugin, model, CONVENTIONS + one_sided_notes(model))


def one_sided_notes(model: ExportModel) -> tuple[str, ...]:
    """Lines for the axes whose two directions differ: by how much their terminal speeds are off the mean's."""
    notes: tuple[str, ...] = ()
    for axis, top in zip(AXES, model.top_speed, strict=True):
        drag = model.hydrodynamics.drag(axis)
        if drag.k_q_negative is None:
            continue
        mean = law_of(*mean_of_directions(drag))
        misfit = max(terminal_misfit(law_of(*drag.of(backward=side)), mean, top) for side in (False, True))
        span = f"from {LOWEST_SHARE * top:.2g} to {top:.2g}"
        notes += (f"{axis} {ONE_SIDED}; terminal speeds within {100.0 * misfit:.1f} % {span}.",)
    return notes
