"""URDF of a vehicle for programs that command its thrusters: that of `robot_description`, with `ros2_control` joints.

On the graph the thrusters are fixed frames, which no one has to publish. A `ros2_control` system wants joints that can
move, so here each thruster turns about the axis of its thrust, and takes an *effort* that is its thrust in newtons, as
the thruster controllers of underwater vehicles have it. The hardware named is the mock of `ros2_control`: put the
plugin of your simulator or vehicle there.
"""

from xml.etree import ElementTree as ET

from hindrax_analysis.exports.export_model import numbers, thrust_range_N
from hindrax_core.messages.frames import robot_of, urdf_text
from hindrax_core.vehicle import Vehicle

MOCK = "mock_components/GenericSystem"


def write(vehicle: Vehicle) -> str:
    """URDF text: frames, mass and envelope, a continuous joint per thruster and its effort in newtons."""
    robot = robot_of(vehicle)
    control = ET.SubElement(robot, "ros2_control", name=f"{vehicle.name}_thrusters", type="system")
    ET.SubElement(ET.SubElement(control, "hardware"), "plugin").text = MOCK
    for thruster in vehicle.thrusters:
        name = f"{thruster.name}_link_joint"
        turning = next(one for one in robot.findall("joint") if one.get("name") == name)
        turning.set("type", "continuous")
        ET.SubElement(turning, "axis", xyz="1 0 0")
        joint = ET.SubElement(control, "joint", name=name)
        effort = ET.SubElement(joint, "command_interface", name="effort")
        for limit, value in zip(("min", "max"), thrust_range_N(vehicle, thruster), strict=True):
            ET.SubElement(effort, "param", name=limit).text = numbers(value)
        ET.SubElement(joint, "state_interface", name="effort")
    return urdf_text(robot)
