"""The node under every node of ours: a parameter request is data, refused with a reason where it is wrong.

The services that rclpy gives to a node raise at a type that they do not know, such as 255, and an exception in a
callback ends the process.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.parameter_service import ParameterService

from hindrax_core.events import Stamp
from hindrax_ros.parameters import why_fixed
from hindrax_ros.stack_time import StackTime

CLOCK = "use_sim_time"
SETTABLE = {kind.value for kind in Parameter.Type} - {Parameter.Type.NOT_SET.value}
"""Types of a value; without one a parameter would be deleted."""
SHOWN = 40
"""Letters of an unknown name that a report shows."""


class CheckedNode(Node):
    """A node whose parameter services, where it has them, answer every request, also an invalid one."""

    def __init__(self, name: str, *, start_parameter_services: bool = True, **options: Any) -> None:
        super().__init__(name, start_parameter_services=False, **options)
        if start_parameter_services:
            CheckedParameterService(self)  # kept alive by its services
        self.stack_time = StackTime.of(os.environ)

    def now(self) -> Stamp:
        """Time of the stack, which no step of the wall clock moves; in mock, and outside of a stack, ROS time."""
        if self.stack_time.epoch_ns is None:
            return Stamp(self.get_clock().now().nanoseconds)
        return self.stack_time.now()


class CheckedParameterService(ParameterService):
    """The parameter services of rclpy, with the two that set parameters replaced."""

    def _set_parameters_callback(self, request: Any, response: Any) -> Any:
        response.results = [self._set([one]) for one in request.parameters]
        return response

    def _set_parameters_atomically_callback(self, request: Any, response: Any) -> Any:
        response.result = self._set(request.parameters)
        return response

    def _set(self, messages: Sequence[Any]) -> SetParametersResult:
        node = self._get_node()
        try:
            wanted = [_parameter(node, one) for one in messages]
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return node.set_parameters_atomically(wanted)


def _parameter(node: Node, message: Any) -> Parameter:
    """Parameter of a message; ValueError names what is invalid."""
    name, kind = message.name, message.value.type
    if not node.has_parameter(name):  # rclpy checks too, but accepts an empty name
        raise ValueError(f"{name[:SHOWN]!r}: no such parameter; `ros2 param list` names them all")
    if name == CLOCK:
        raise ValueError(f"{CLOCK}: fixed at start, since all stamps hang on the clock; start the node anew")
    if kind not in SETTABLE:
        raise ValueError(f"{name}: found the type {kind}, wanted one of rcl_interfaces/msg/ParameterType, 1 to 9")
    if why := why_fixed(node.describe_parameter(name)):
        raise ValueError(f"{name}: fixed at start, since {why}; start the node anew")
    return _as_declared(Parameter.from_parameter_msg(message), node.get_parameter(name).type_)


def _as_declared(found: Parameter, declared: Parameter.Type) -> Parameter:
    """Parameter of the declared type, where whole numbers are given for floats."""
    if (found.type_, declared) == (Parameter.Type.INTEGER, Parameter.Type.DOUBLE):
        return Parameter(found.name, declared, float(found.value))
    if (found.type_, declared) == (Parameter.Type.INTEGER_ARRAY, Parameter.Type.DOUBLE_ARRAY):
        return Parameter(found.name, declared, [float(one) for one in found.value])
    return found
