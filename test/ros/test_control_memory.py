"""What a control process that was killed leaves to the one that is started in its place."""

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy

from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import adopted, environment, own_domain
from hindrax_control.nodes.navigator_node import NavigatorNode
from hindrax_core.events import Stamped, stamp_from_s
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Inertial
from hindrax_core.vehicle import load_vehicle
from hindrax_ros.heartbeat import VARIABLE

pytestmark = pytest.mark.ros
OFFSET = (0.03, -0.02, 0.025)


@pytest.fixture
def navigators(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[tuple[NavigatorNode, NavigatorNode]]:
    """One that rested for four seconds, and the one of the next process of the same supervisor."""
    monkeypatch.setenv(VARIABLE, str(tmp_path / "control"))
    vehicle = load_vehicle(default_vehicle())
    with own_domain(mock=True) as domain, adopted(environment(mock=True, domain=domain)):
        rclpy.init(args=[])
        first = NavigatorNode(vehicle)
        for number in range(1, 400):
            sample = Inertial((0.0, 0.0, -GRAVITY_mps2), OFFSET, 20.0)
            found = first._navigator.step(Stamped(stamp_from_s(0.01 * number), sample), "icm20948")
            if found is not None:
                first._publish(found)
        second = NavigatorNode(vehicle)
        try:
            yield first, second
        finally:
            for one in (first, second):
                one.destroy_node()
            rclpy.try_shutdown()


def test_the_next_navigator_knows_the_gyroscope(navigators: tuple[NavigatorNode, NavigatorNode]) -> None:
    first, second = navigators
    known = first._navigator.gyroscope_offset
    assert known is not None
    assert second._navigator._offset.rate_radps == pytest.approx(known.rate_radps, abs=1e-3)
    assert second._navigator._offset.sigma_radps == pytest.approx(known.sigma_radps, rel=0.1)
