"""MuJoCo: a vehicle in MJCF, and the module that brings its water.

MuJoCo's own fluid models derive drag and added mass from the shapes of the geometry; none of them carries an identified
law. So the model switches its fluid off, and a module of Python applies buoyancy, drag, added mass and its Coriolis
terms between the two halves of a step. Added mass there is solved together with the mass, not put in one step late: the
force is the one under which MuJoCo, which knows the dry mass alone, gives the acceleration of the wet vehicle. It
therefore stays stable whatever the added mass. A contact is solved with the dry mass.

Axes: MuJoCo's world has z up; the body is x forward, y left, z up, its origin at the center of mass.
"""

import math
from collections.abc import Mapping
from xml.etree import ElementTree as ET

from hindrax_analysis.exports import python_model
from hindrax_analysis.exports.export_model import ExportModel, commented, numbers, thrust_range_N
from hindrax_core.readings import Vec3
from hindrax_core.topics import ros_name
from hindrax_core.vehicle import Thruster

CONVENTIONS = (
    "For MuJoCo 3.2 and later. Body axes x forward, y left, z up; the body's origin is the center of mass.",
    (
        "This file is the dry vehicle: weight without buoyancy, drag or added mass, which are positive numbers in"
        " hydrodynamics.py and which mujoco_vehicle.py applies in every step."
    ),
    "Controls are thrusts in newton, one per thruster, behind a first-order lag.",
)
STEP_S = 0.002
FOLDER = ("vehicle.xml", "hydrodynamics.py", "mujoco_vehicle.py", "ros_vehicle.py", "README.md")


def write(model: ExportModel) -> str:
    """MJCF text of the dry vehicle with its thrusters."""
    vehicle = model.vehicle
    root = ET.Element("mujoco", model=vehicle.name)
    ET.SubElement(root, "compiler", angle="radian")
    # Fluid of its own would act a second time.
    ET.SubElement(root, "option", timestep=numbers(STEP_S), gravity="0 0 -9.80665", density="0", viscosity="0")
    visual = ET.SubElement(root, "visual")
    ET.SubElement(visual, "headlight", diffuse="0.7 0.7 0.7")
    world = ET.SubElement(root, "worldbody")
    body = ET.SubElement(world, "body", name="base_link", pos="0 0 -1")
    ET.SubElement(body, "freejoint", name="base")
    ET.SubElement(body, "inertial", pos="0 0 0", mass=numbers(vehicle.mass_kg), diaginertia=numbers(*vehicle.inertia))
    half = numbers(*(0.5 * edge for edge in vehicle.envelope_m))
    at = _up(model.arm_m((0.0, 0.0, 0.0)))
    # Contacts with the envelope are yours to switch on: set contype and conaffinity.
    ET.SubElement(body, "geom", name="envelope", type="box", size=half, pos=at, rgba="0.2 0.5 0.9 0.4",
                  contype="0", conaffinity="0")  # fmt: skip
    for thruster in vehicle.thrusters:
        direction = _up(thruster.direction)
        ET.SubElement(body, "site", name=thruster.name, pos=_up(model.arm_m(thruster.position_m)), zaxis=direction,
                      type="cylinder", size="0.04 0.04", rgba="0.1 0.1 0.1 1")  # fmt: skip
    for name, mount in vehicle.sensors.items():
        roll, pitch, yaw = (math.radians(angle) for angle in mount.rotation_deg)
        # SNAME to z up: pitch and yaw turn the other way.
        ET.SubElement(body, "site", name=name, pos=_up(model.arm_m(mount.position_m)),
                      euler=numbers(roll, -pitch, -yaw), size="0.02")  # fmt: skip
    actuator = ET.SubElement(root, "actuator")
    for thruster in vehicle.thrusters:
        _thruster(actuator, model, thruster)
    sensor = ET.SubElement(root, "sensor")
    ET.SubElement(sensor, "framequat", name="attitude", objtype="body", objname="base_link")
    ET.SubElement(sensor, "framepos", name="position", objtype="body", objname="base_link")
    for name in vehicle.sensors:
        ET.SubElement(sensor, "velocimeter", name=f"{name}_velocity", site=name)
        ET.SubElement(sensor, "gyro", name=f"{name}_rates", site=name)
        ET.SubElement(sensor, "accelerometer", name=f"{name}_force", site=name)
    return commented(root, model, CONVENTIONS)


def folder(model: ExportModel) -> Mapping[str, str]:
    """Files of a folder that `python mujoco_vehicle.py` drives: vehicle, water, steps, node, four lines of help."""
    first = model.vehicle.thrusters[0].name if model.vehicle.thrusters else "T1"
    name = ros_name(model.vehicle.name)
    node = ON_THE_GRAPH.replace("VEHICLE", name)
    texts = (write(model), python_model.write(model), STEPS, node, README.format(thruster=first, name=name))
    return dict(zip(FOLDER, texts, strict=True))


def _thruster(actuator: ET.Element, model: ExportModel, thruster: Thruster) -> None:
    low, high = thrust_range_N(model.vehicle, thruster)
    ET.SubElement(
        actuator,
        "general",
        name=thruster.name,
        site=thruster.name,
        gear="0 0 1 0 0 0",
        ctrllimited="true",
        ctrlrange=numbers(low, high),
        dyntype="filterexact" if thruster.lag_s > 0.0 else "none",
        dynprm=numbers(thruster.lag_s if thruster.lag_s > 0.0 else 1.0),
        gainprm="1",
    )


def _up(vector_m: Vec3) -> str:
    """From forward, starboard, down to forward, left, up."""
    x, y, z = vector_m
    return numbers(x, -y, -z)


STEPS = '''"""Steps a MuJoCo model of the vehicle in water. Needs mujoco and numpy.

    vehicle = UnderwaterVehicle.from_folder(".")
    vehicle.data.ctrl[:] = 5.0          # thrust of every thruster [N]
    vehicle.step()
"""

import importlib.util
import sys
from pathlib import Path

import mujoco
import numpy as np

TURN = np.array([1.0, -1.0, -1.0])  # x forward, y left, z up <-> x forward, y starboard, z down


class UnderwaterVehicle:
    """Model, data and water of one vehicle; `current` is the velocity of the water in the world [m/s], z up."""

    def __init__(self, model, water, current=(0.0, 0.0, 0.0)):
        self.model, self.water, self.current = model, water, np.array(current)
        self.data = mujoco.MjData(model)
        self._dof = model.jnt_dofadr[model.body_jntadr[model.body("base_link").id]]
        self._body = model.body("base_link").id
        self._acceleration = np.zeros(6)

    @classmethod
    def from_folder(cls, folder):
        """Load vehicle.xml and hydrodynamics.py of a folder."""
        spec = importlib.util.spec_from_file_location("hydrodynamics", Path(folder) / "hydrodynamics.py")
        water = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(water)
        return cls(mujoco.MjModel.from_xml_path(str(Path(folder) / "vehicle.xml")), water)

    @property
    def velocity(self):
        """Velocity of the center of mass and rates, SNAME body axes [m/s, rad/s], over ground."""
        turn, v = self._turn(), self.data.qvel[self._dof : self._dof + 6]
        return np.concatenate((TURN * (turn.T @ v[:3]), TURN * v[3:]))

    def step(self, wrench=(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)):
        """One step with a wrench at the center of mass, added to the thrusters', in SNAME body axes [N, N m].

        A push by `data.xfrc_applied` (world axes) counts as well; a contact or a constraint moves the dry body alone.
        """
        model, data, dof = self.model, self.data, self._dof
        mujoco.mj_step1(model, data)
        mujoco.mj_fwdActuation(model, data)
        turn = self._turn()
        dry = (data.qfrc_passive - data.qfrc_bias + data.qfrc_actuator)[dof : dof + 6]
        push = data.xfrc_applied[self._body]
        dry = np.concatenate((TURN * (turn.T @ (dry[:3] + push[:3])), TURN * (dry[3:] + turn.T @ push[3:])))
        applied = wrench + self._water(dry + wrench, self.velocity, turn)
        data.qfrc_applied[dof : dof + 3] = turn @ (TURN * applied[:3])
        data.qfrc_applied[dof + 3 : dof + 6] = TURN * applied[3:]
        mujoco.mj_step2(model, data)

    def _turn(self):
        return self.data.xmat[self._body].reshape(3, 3)

    def _water(self, dry, velocity, turn):
        """Wrench under which the dry body moves as the wet one does, SNAME.

        `dry` is what acts on the dry body, its own Coriolis terms and its weight included.
        """
        water = self.water
        stream = np.concatenate((TURN * (turn.T @ self.current), np.zeros(3)))
        relative, rates = velocity - stream, velocity[3:]
        carried = np.concatenate((np.cross(rates, water.MASS_kg * velocity[:3]), np.zeros(3)))
        down = TURN * (turn.T @ np.array([0.0, 0.0, -1.0]))
        lift = -water.BUOYANCY_N * down
        buoyancy = np.concatenate((lift, np.cross(water.CENTER_OF_BUOYANCY_m, lift)))
        momentum = 0.5 * (water.ADDED_MASS + water.ADDED_MASS.T) @ relative
        coriolis = -np.concatenate((
            np.cross(momentum[:3], rates), np.cross(momentum[:3], relative[:3]) + np.cross(momentum[3:], rates)
        ))
        # In turning axes a steady stream turns too: its added mass feels that, not the body.
        turning = water.ADDED_MASS @ np.concatenate((np.cross(rates, stream[:3]), np.zeros(3)))
        # Drag in the middle of the step: taken at its beginning, a light vehicle would overshoot.
        drag = water.drag(relative + 0.5 * self.model.opt.timestep * self._acceleration)
        self._acceleration = water.INVERSE_MASS @ (dry - carried + buoyancy - coriolis - drag - turning)
        return water.RIGID_BODY_MASS @ self._acceleration + carried - dry


if __name__ == "__main__":
    vehicle = UnderwaterVehicle.from_folder(Path(__file__).parent)
    vehicle.data.ctrl[:] = float(sys.argv[1]) if len(sys.argv) > 1 else 0.0
    print("time s, velocity u v w p q r")
    for tick in range(5001):
        if tick % 500 == 0:
            print(f"{vehicle.data.time:6.1f}", np.round(vehicle.velocity, 4))
        vehicle.step()
'''

ON_THE_GRAPH = '''"""Puts the vehicle of this folder on the ROS graph. Needs rclpy beside mujoco and numpy.

    python ros_vehicle.py --ros-args -p rate:=1.0

out  /VEHICLE/odometry    nav_msgs/Odometry of the center of mass, 100 Hz of its own time
in   /VEHICLE/thrusters   std_msgs/Float64MultiArray, the thrust of each thruster [N]

Time begins when somebody computes thrusts, and goes on with the answer to each odometry, or after `patience` (s): who
computes them may be slow.
"""

import time
from pathlib import Path

import mujoco_vehicle
import rclpy
from nav_msgs.msg import Odometry
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64MultiArray

PERIOD = 0.01


class RosVehicle:
    """Node, vehicle, and the clock of both."""

    def __init__(self, node):
        self.node = node
        self.vehicle = mujoco_vehicle.UnderwaterVehicle.from_folder(Path(__file__).parent)
        self.rate = node.declare_parameter("rate", 1.0).value  # times real time at most; 0: no bound
        self.patience = node.declare_parameter("patience", 1.0).value
        self.out = node.create_publisher(Odometry, "/VEHICLE/odometry", 10)
        self.inlet = node.create_subscription(Float64MultiArray, "/VEHICLE/thrusters", self.take, 1)
        self.answered = False

    def take(self, message):
        self.vehicle.data.ctrl[:] = message.data
        self.answered = True

    def publish(self):
        data, message = self.vehicle.data, Odometry(child_frame_id="base_link")
        seconds = 1.0 + data.time  # a stamp of zero means that there is none
        message.header.frame_id = "odom"
        message.header.stamp.sec = int(seconds)
        message.header.stamp.nanosec = int(1e9 * (seconds % 1.0))
        pose, twist = message.pose.pose, message.twist.twist
        pose.position.x, pose.position.y, pose.position.z = map(float, data.sensor("position").data)
        w, x, y, z = map(float, data.sensor("attitude").data)
        pose.orientation.w, pose.orientation.x, pose.orientation.y, pose.orientation.z = w, x, y, z
        u, v, w, p, q, r = map(float, self.vehicle.velocity)  # z down; the message has z up
        twist.linear.x, twist.linear.y, twist.linear.z = u, -v, -w
        twist.angular.x, twist.angular.y, twist.angular.z = p, -q, -r
        self.out.publish(message)

    def turn(self):
        """Publish, wait for the answer, and go on by one period."""
        began = time.monotonic()
        self.answered = False
        self.publish()
        while not self.answered and time.monotonic() < began + self.patience:
            rclpy.spin_once(self.node, timeout_sec=0.01)
        if not self.answered:
            self.vehicle.data.ctrl[:] = 0.0
        if self.node.count_publishers("/VEHICLE/thrusters"):
            until = self.vehicle.data.time + PERIOD - 1e-9
            while self.vehicle.data.time < until:
                self.vehicle.step()
        if self.rate > 0.0:
            time.sleep(max(0.0, began + PERIOD / self.rate - time.monotonic()))


if __name__ == "__main__":
    # Ctrl-C is Python's: rclpy would close the context in the middle of a wait, which is another error each time.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    try:
        vehicle = RosVehicle(rclpy.create_node("mujoco_vehicle"))
        while rclpy.ok():
            vehicle.turn()
    except KeyboardInterrupt:
        pass
'''

README = """Open: `python -m mujoco.viewer --mjcf=vehicle.xml` shows it dry, `python mujoco_vehicle.py` moves it.
Drive: `UnderwaterVehicle.from_folder(".")`, `vehicle.data.actuator("{thruster}").ctrl = 5.0` (N), `vehicle.step()`.
On the ROS graph: `python ros_vehicle.py`, then `./hindrax pool-test --mock --simulator mujoco:/{name} --vehicle FILE`.
Numbers, signs, reference point and their uncertainty: the comment on top of `vehicle.xml` and of `hydrodynamics.py`.
"""
