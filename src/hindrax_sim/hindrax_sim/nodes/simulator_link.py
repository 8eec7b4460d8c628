"""The vehicle of another simulator on the graph: its odometry moves the mock, and its thrusters get the mock's forces.

The stamps of the odometry are the time of the mock, so a simulator that is slow, fast or paused takes the whole stack
with it.
"""

import time
from collections import deque
from collections.abc import Callable
from typing import TypeAlias

from nav_msgs.msg import Odometry
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64, Float64MultiArray

from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp, to_s
from hindrax_core.vehicle import Vehicle
from hindrax_ros.messages.convert import stamp_from_msg
from hindrax_sim.hardware import STEP_S
from hindrax_sim.physics.followed_plant import FollowedPlant, Sample
from hindrax_sim.simulators import Simulator

Send: TypeAlias = Callable[[list[float]], None]
"""Send the force of each thruster [N], in the order of the vehicle file."""
FIRST_WITHIN_S = 45.0
"""Wall time that a simulator has to publish its first state."""
SILENT_S = 1.0
"""Wall time without a state after which the thrusters get zero: a paused simulator must not go on with our last."""
ENDED_S = 10.0
"""Wall time without a state after which it has ended: soon the processes that sleep in its time would count as hung
(`hindrax_bringup.supervisor.HUNG_S`)."""
ROUNDING_S = 1e-6


class SimulatorLink:
    """Brings states from the graph to a plant, and its forces to the graph."""

    def __init__(self, node: Node, simulator: Simulator, vehicle: Vehicle, plant: FollowedPlant) -> None:
        self._node, self._simulator, self._plant = node, simulator, plant
        self._executor = SingleThreadedExecutor(context=node.context)
        self._executor.add_node(node)
        # A sender of either reliability is heard.
        quality = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
        node.create_subscription(Odometry, simulator.odometry, self._on_odometry, quality)
        self._send = _sender(node, simulator.thrust, [one.name for one in vehicle.thrusters])
        self._heard_s = time.monotonic()
        self._unanswered_s: deque[float] = deque()
        self._silent = False
        self._failure = ""

    def wait_for_first(self, over: Callable[[], bool]) -> None:
        """Wait for the simulator; HindraxError when it says nothing, with what is on the graph instead."""
        deadline_s = time.monotonic() + FIRST_WITHIN_S
        while not (self._plant.followed or over()):
            if time.monotonic() > deadline_s:
                raise HindraxError(self._nobody())
            self.serve(0.1)

    def serve(self, seconds: float) -> None:
        """Take what has come, waiting so long for the first; HindraxError for a simulator that cannot be followed."""
        self._executor.spin_once(timeout_sec=seconds)
        if self._failure:
            raise HindraxError(self._failure)
        silent = time.monotonic() - self._heard_s > SILENT_S
        if silent and not self._silent:
            self.rest()
        self._silent = silent

    def require_going_on(self) -> None:
        """HindraxError for a simulator that has ended, or stands still for too long."""
        if time.monotonic() - self._heard_s > ENDED_S:
            raise HindraxError(
                f"{self._simulator.odometry}: the simulator published no state for {ENDED_S:g} s; has it ended, or is "
                "it paused? Start it and the stack again"
            )

    def may_step(self) -> bool:
        """Whether the simulator has reached the next step of the mock."""
        return self._plant.reached_s >= self._plant.time_s + STEP_S - ROUNDING_S

    def rest(self) -> None:
        """Send no force."""
        self._send([0.0] * len(self._plant.targets_N))

    def push(self, _now: Stamp) -> None:
        """Answer every state that the mock has reached with the forces of the pulses that are on the output now.

        One answer to each, so that a simulator which waits for them cannot run ahead of the stack.
        """
        while self._unanswered_s and self._unanswered_s[0] <= self._plant.time_s + ROUNDING_S:
            self._unanswered_s.popleft()
            self._send(list(self._plant.targets_N))

    def _on_odometry(self, message: Odometry) -> None:
        pose, twist = message.pose.pose, message.twist.twist
        x, y, z = self._simulator.signs
        at, turn = pose.position, pose.orientation
        linear, angular = twist.linear, twist.angular
        stamp_s = to_s(stamp_from_msg(message.header.stamp))
        sample = Sample(
            stamp_s,
            (x * at.x, y * at.y, z * at.z),
            (turn.w, x * turn.x, y * turn.y, z * turn.z),
            (x * linear.x, y * linear.y, z * linear.z, x * angular.x, y * angular.y, z * angular.z),
        )
        before_s = self._plant.reached_s
        try:
            self._plant.follow(sample)
            if self._plant.reached_s > before_s:
                self._unanswered_s.append(self._plant.reached_s)
        except ValueError as error:
            again = "was it reset? start the stack again"
            self._failure = self._failure or f"{self._simulator.odometry}: {error}; {again}"
        self._heard_s = time.monotonic()

    def _nobody(self) -> str:
        kinds: list[tuple[str, list[str]]] = self._node.get_topic_names_and_types()
        others = sorted(name for name, types in kinds if "nav_msgs/msg/Odometry" in types)
        others = [name for name in others if self._node.count_publishers(name)]
        found = f"found odometry on {', '.join(others)}" if others else "found no odometry on the graph"
        return (
            f"{self._simulator.odometry}: the simulator published no state for {FIRST_WITHIN_S:g} s; {found}; start "
            f"{self._simulator.start} in the same ROS domain, or name its prefix: --simulator KIND:/PREFIX"
        )


def _sender(node: Node, topic: str, thrusters: list[str]) -> Send:
    """One topic with an array, or one per thruster."""
    if "{thruster}" not in topic:
        array: Publisher = node.create_publisher(Float64MultiArray, topic, 1)
        return lambda forces: array.publish(Float64MultiArray(data=forces))
    singles: list[Publisher] = [node.create_publisher(Float64, topic.format(thruster=name), 1) for name in thrusters]

    def send(forces: list[float]) -> None:
        for single, force in zip(singles, forces, strict=True):
            single.publish(Float64(data=force))

    return send
