"""The pilot node and an operator, by messages: what is told of a maneuver while it is flown."""

import time
from collections.abc import Iterator

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

from rclpy.action import ActionClient
from rclpy.executors import SingleThreadedExecutor

from hindrax_bringup.nodes.operator import Operator
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_bringup.vehicles import default_vehicle
from hindrax_control.nodes.pilot import PilotNode
from hindrax_control.supply import Supply
from hindrax_core.events import Stamp, Stamped, after
from hindrax_core.state import Estimate, Navigation
from hindrax_core.topics import ESTIMATE, THRUSTER_STATE
from hindrax_core.vehicle import load_vehicle
from hindrax_msgs.action import FlyManeuver
from hindrax_msgs.msg import ThrusterState
from hindrax_ros.convert import estimate_to_msg, stamp_to_msg
from hindrax_ros.graph import publisher

pytestmark = pytest.mark.ros

PATIENT_S = 60.0
AGES_S = {"icm20948": 0.01, "ms5837": 0.02, "ping1d": 0.05, "dvl75": 0.05}
ADRIFT = Navigation(
    (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.1, 0.0, 0.0), 0.9, 0.9, (0.0, 0.0), dvl_locked=True, ages_s=AGES_S
)
"""Never at rest, so that a maneuver stays at its first stage."""


class Bench:
    """A pilot who is told that all is well, and an operator whose every turn is one cycle of that pilot."""

    def __init__(self) -> None:
        self.operator = Operator(mock=False, tick=self.turn)
        vehicle = load_vehicle(default_vehicle())
        self.pilot = PilotNode(vehicle, Supply(vehicle.supply_V), give=lambda *_: None)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.pilot)
        self._thrusters = publisher(self.operator.node, THRUSTER_STATE, held=False)
        self.estimates = publisher(self.operator.node, ESTIMATE, held=False)
        self.state = ThrusterState(armed=False, state="disarmed", reason="not armed since start", pulses=[1500.0] * 8)
        self.navigation: Navigation | None = ADRIFT
        self.later_s = 0.0

    def now(self) -> Stamp:
        return after(self.operator.now(), self.later_s)

    def turn(self) -> None:
        self.state.header.stamp = stamp_to_msg(self.now())
        self._thrusters.publish(self.state)
        self._executor.spin_once(timeout_sec=0.0)
        self.pilot.drain()
        if self.navigation is not None:
            self.pilot.take(Stamped(self.now(), self.navigation))
        self.pilot.outbox.flush()

    def until(self, done) -> None:
        self.operator.wait(done, PATIENT_S, lambda: "the bench")

    def say_armed(self, *, armed: bool, reason: str = "") -> None:
        self.state.armed, self.state.reason = armed, reason
        self.state.state = "armed" if armed else "disarmed"
        self.until(lambda: self.operator.thrusters is not None and self.operator.thrusters.armed is armed)

    def close(self) -> None:
        self._executor.shutdown()
        self.pilot.close()
        self.pilot.destroy_node()
        self.operator.__exit__()


@pytest.fixture
def bench() -> Iterator[Bench]:
    with own_domain(mock=True) as domain, adopted(environment(mock=True, domain=domain)):
        made = Bench()
        made.operator.wait_for_time()
        try:
            yield made
        finally:
            made.close()


def estimate(stamp: Stamp, **changes) -> Stamped[Estimate]:
    told = {
        "motion": "surge",
        "names": ("k_q", "k_l"),
        "units": ("N s^2/m^2", "N s/m"),
        "values": (66.1, 1.3),
        "covariance": ((0.16, 0.0), (0.0, 0.25)),
        "samples": 120,
        "effective_samples": 80.0,
        "learning": True,
        "reason": "",
    }
    return Stamped(stamp, Estimate(**(told | changes)))


def test_feedback_tells_what_is_known_of_the_motion_flown(bench: Bench) -> None:
    bench.say_armed(armed=True)
    heard = []
    client = ActionClient(bench.operator.node, FlyManeuver, "maneuver/fly")
    bench.until(client.server_is_ready)
    goal = FlyManeuver.Goal(motions=["surge"], excitation="plateaus", on_cancel="neutral")
    goal.stamp = stamp_to_msg(bench.now())
    client.send_goal_async(goal, feedback_callback=lambda message: heard.append(message.feedback))
    bench.until(lambda: heard)
    assert (heard[-1].motion, heard[-1].phase) == ("surge", "settle")
    assert not heard[-1].coefficients
    assert not heard[-1].learning

    def told(done) -> None:
        deadline = time.monotonic() + PATIENT_S
        while not done(heard[-1]):
            assert time.monotonic() < deadline, heard[-1]
            bench.operator.spin()

    bench.estimates.publish(estimate_to_msg(estimate(bench.now(), motion="sway", values=(1.0, 2.0))))
    bench.estimates.publish(estimate_to_msg(estimate(bench.now())))
    told(lambda last: last.learning)
    assert heard[-1].coefficients == ["k_q", "k_l"]
    assert heard[-1].units == ["N s^2/m^2", "N s/m"]
    assert list(heard[-1].estimates) == [66.1, 1.3]
    assert list(heard[-1].sigmas) == pytest.approx([0.4, 0.5])
    told(lambda last: not last.learning)  # nothing is heard of the identifier any more
    assert list(heard[-1].estimates) == [66.1, 1.3]
    client.destroy()
