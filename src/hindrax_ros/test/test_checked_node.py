"""What becomes of a request to set parameters: taken where it is valid, else refused with a reason."""

from collections.abc import Iterator

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")

import rclpy
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.context import Context

from hindrax_ros.parameters import CheckedNode, CheckedParameterService

DOMAIN = 101
"""No stack uses it: those take 1 to 100."""
DOUBLE = 3


@pytest.fixture
def node(monkeypatch: pytest.MonkeyPatch) -> Iterator[CheckedNode]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = Context()
    rclpy.init(args=[], context=context, domain_id=DOMAIN)
    made = CheckedNode("checked", context=context)
    made.declare_parameter("gain", 1.0)
    yield made
    made.destroy_node()
    rclpy.try_shutdown(context=context)


def gain(value: float, name: str = "gain", kind: int = DOUBLE) -> Parameter:
    return Parameter(name=name, value=ParameterValue(type=kind, double_value=value))


BAD = {
    "found the type 255, wanted": gain(3.0, kind=255),
    "found the type 0, wanted": gain(3.0, kind=0),
    "'': no such parameter": gain(3.0, name=""),
    "'gian': no such parameter": gain(3.0, name="gian"),
    "use_sim_time: fixed at start": Parameter(name="use_sim_time", value=ParameterValue(type=1, bool_value=True)),
    "Wrong parameter type": gain(3.0, kind=4),
}


@pytest.mark.parametrize("why", BAD)
def test_each_is_judged_by_itself_and_atomically_all_or_none(node: CheckedNode, why: str) -> None:
    service = CheckedParameterService(node)
    request = SetParameters.Request(parameters=[gain(2.0), BAD[why], gain(2.5)])
    results = service._set_parameters_callback(request, SetParameters.Response()).results
    assert [one.successful for one in results] == [True, False, True]
    assert why in results[1].reason
    assert node.get_parameter("gain").value == 2.5
    together = SetParametersAtomically.Request(parameters=[gain(4.0), BAD[why]])
    result = service._set_parameters_atomically_callback(together, SetParametersAtomically.Response()).result
    assert not result.successful
    assert why in result.reason
    assert node.get_parameter("gain").value == 2.5


def test_its_services_are_the_checked_ones(node: CheckedNode) -> None:
    setting = [one for one in node.services if "/set_parameters" in one.srv_name]
    assert len(setting) == 2
    assert all(isinstance(one.callback.__self__, CheckedParameterService) for one in setting)
