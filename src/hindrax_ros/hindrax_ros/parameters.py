"""ROS parameters from knob dataclasses: declared once, described with unit and range, read back and checked.

A parameter request is data, refused with a reason where it is wrong: the services that rclpy gives to a node raise at a
type that they do not know, such as 255, and an exception in a callback ends the process.
"""

import difflib
import math
import os
import re
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from operator import attrgetter
from types import MappingProxyType
from typing import TypeVar

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import SetParameters, SetParametersAtomically
from rclpy.node import Node
from rclpy.parameter import Parameter, get_parameter_value
from rclpy.parameter_service import ParameterService

from hindrax_core.errors import UsageError
from hindrax_core.events import Stamp
from hindrax_core.knobs import Knob, build, leaves, nested
from hindrax_core.stack_time import StackTime
from hindrax_ros.parameter_file import FRAME_PREFIX

T = TypeVar("T")

SAFETY = "it guards the vehicle"
SETUP = "it is used only as the node starts"
FIXED: Mapping[str, str] = MappingProxyType({})
ONLY = "fixed at start, since "

OF_EVERY_NODE = frozenset(("vehicle", FRAME_PREFIX))
"""Given to every node of a stack, and declared by those that read it."""

RENAMED = {"box.": "pool_bounds.", "hand.": "operator_wrench.", "safety.": "guards.", "watch.": "fault_detector."}
"""Groups of parameters that had another name: old prefix, new prefix."""
CLOCK = "use_sim_time"
SETTABLE = {kind.value for kind in Parameter.Type} - {Parameter.Type.NOT_SET.value}
"""Types of a value; without one a parameter would be deleted."""
SHOWN = 40
"""Letters of an unknown name that a report shows."""


def text(node: Node, name: str, default: str, meaning: str) -> str:
    """Declare one text parameter, fixed at start.

    Parameters
    ----------
    node, name, default
        Of the parameter.
    meaning
        For `ros2 param describe`.

    Returns
    -------
    str
        Its value.
    """
    descriptor = ParameterDescriptor(description=meaning, read_only=True)
    return str(node.declare_parameter(name, default, descriptor).value)


def frame_prefix(node: Node) -> str:
    """Declare the prefix of every frame that the node publishes, as robot_state_publisher has it.

    Parameters
    ----------
    node
        Of the parameter.

    Returns
    -------
    str
        Its value, such as `rov1/`.

    Raises
    ------
    UsageError
        For what is no prefix.
    """
    prefix = text(node, FRAME_PREFIX, "", "prefix of its frames, such as rov1/ [-]")
    if not re.fullmatch(r"(?:[A-Za-z]\w*/)*", prefix, re.ASCII):
        raise UsageError(f"{node.get_name()}.{FRAME_PREFIX}: found {prefix!r}, wanted a name that ends in /, as rov1/")
    return prefix


def whole(node: Node, name: str, default: int | None, meaning: str) -> int | None:
    """Declare one whole number, fixed at start.

    Parameters
    ----------
    node, name, default
        Of the parameter; None: not set.
    meaning
        For `ros2 param describe`.

    Returns
    -------
    int | None
        Its value; None, or an empty text, where it is not set.

    Raises
    ------
    UsageError
        For a text that is no whole number.
    """
    descriptor = ParameterDescriptor(description=meaning, read_only=True, dynamic_typing=True)
    value = node.declare_parameter(name, default, descriptor).value
    if value in (None, ""):
        return None
    if not isinstance(value, int) or isinstance(value, bool):
        raise UsageError(f"{node.get_name()}.{name}: found {value!r}, wanted a whole number ({meaning})")
    return value


def knobs(node: Node, cls: type[T], tune: Callable[[T], None] | None = None, *, fixed: Mapping[str, str] = FIXED) -> T:
    """Declare every knob of a dataclass as a parameter of the node.

    Knobs of a nested dataclass are declared as `field.knob`. A whole number is accepted for a float.

    Parameters
    ----------
    node
        Of the parameters.
    cls
        Dataclass of knobs.
    tune
        Gets a new instance when parameters have changed while the node runs; None: they cannot.
    fixed
        Why those whose names begin so cannot.

    Returns
    -------
    T
        A checked instance of their values. UsageError names a value that is wrong.
    """
    given = node._parameter_overrides  # noqa: SLF001  # rclpy offers no other way to them
    names = list(leaves(cls))
    made = build(cls, nested({name: _plain(given[name].value) for name in names if name in given}), node.get_name())
    for name, knob in leaves(cls).items():
        value = _plain(attrgetter(name)(made))
        why = next((why for begin, why in fixed.items() if name.startswith(begin)), "" if tune else SETUP)
        node.declare_parameter(name, value, _descriptor(knob, value, why), ignore_override=True)
    if tune is not None:
        _keep_tuned(node, cls, names, tune)
    return made


def _keep_tuned(node: Node, cls: type[T], names: Sequence[str], tune: Callable[[T], None]) -> None:
    def built(changed: Iterable[Parameter]) -> T:
        values = {name: node.get_parameter(name).value for name in names} | {one.name: one.value for one in changed}
        return build(cls, nested({name: _plain(values[name]) for name in names}), node.get_name())

    def check(changed: list[Parameter]) -> SetParametersResult:
        try:
            built(changed)
        except UsageError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def use(changed: list[Parameter]) -> None:
        if any(one.name in names for one in changed):
            tune(built(()))

    node.add_on_set_parameters_callback(check)
    node.add_post_set_parameters_callback(use)


def renamed(name: str) -> str:
    """What a parameter that had another name is called now; empty for any other."""
    return next((new + name.removeprefix(old) for old, new in RENAMED.items() if name.startswith(old)), "")


def unknown_parameters(
    node: str, given: Iterable[str], declared: Collection[str], elsewhere: Collection[str] = ()
) -> list[str]:
    """Find parameters that nobody declares.

    Parameters
    ----------
    node
        Name of a node.
    given
        Parameters that were given to it.
    declared, elsewhere
        Names that it declares, and that the other nodes of the process do: arguments of a process reach all its nodes.

    Returns
    -------
    list[str]
        One sentence for each that neither declares.
    """
    found = []
    for name in sorted({*given} - {*declared}):
        new = renamed(name)
        if name in elsewhere or (new in elsewhere and new not in declared):
            continue
        near = difflib.get_close_matches(name, declared, n=1)
        hint = f"; it is called {new} now" if new in declared else f"; the nearest is {near[0]}" if near else ""
        found.append(f"parameter {name!r} of {node}: unknown, ignored{hint}")
    return found


def warn_of_unknown_parameters(nodes: Sequence[Node]) -> None:
    """Log a warning for each parameter that was given to the nodes of this process and that none of them declares."""
    declared = {node: node.get_parameters_by_prefix("").keys() for node in nodes}
    for node in nodes:
        given = node._parameter_overrides.keys() - OF_EVERY_NODE  # noqa: SLF001  # rclpy offers no other way to them
        elsewhere = {name for other in nodes if other is not node for name in declared[other]}
        for sentence in unknown_parameters(node.get_name(), given, declared[node], elsewhere):
            node.get_logger().warning(sentence)


def _plain(value: object) -> object:
    return list(value) if isinstance(value, Sequence) and not isinstance(value, str) else value


def _descriptor(knob: Knob, value: object, fixed: str) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(description=knob.meaning, read_only=bool(fixed), dynamic_typing=value is None)
    words = ["one of " + ", ".join(knob.choices)] if knob.choices else []
    descriptor.additional_constraints = "; ".join(words + [ONLY + fixed] * bool(fixed))
    bounded = math.isfinite(knob.low) and math.isfinite(knob.high)
    if bounded and isinstance(value, float):
        descriptor.floating_point_range = [FloatingPointRange(from_value=knob.low, to_value=knob.high)]
    if bounded and isinstance(value, int) and not isinstance(value, bool):
        descriptor.integer_range = [IntegerRange(from_value=int(knob.low), to_value=int(knob.high), step=1)]
    return descriptor


class CheckedNode(Node):
    """A node whose parameter services, where it has them, answer every request, also an invalid one."""

    def __init__(self, name: str, *, start_parameter_services: bool = True, **options: object) -> None:
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

    def _set_parameters_callback(
        self, request: SetParameters.Request, response: SetParameters.Response
    ) -> SetParameters.Response:
        response.results = [self._set([one]) for one in request.parameters]
        return response

    def _set_parameters_atomically_callback(
        self, request: SetParametersAtomically.Request, response: SetParametersAtomically.Response
    ) -> SetParametersAtomically.Response:
        response.result = self._set(request.parameters)
        return response

    def _set(self, messages: Sequence[ParameterMessage]) -> SetParametersResult:
        node = self._get_node()
        try:
            wanted = [_parameter(node, one) for one in messages if not _is_as_asked(node, one)]
        except ValueError as error:
            return SetParametersResult(successful=False, reason=str(error))
        return node.set_parameters_atomically(wanted) if wanted else SetParametersResult(successful=True)


def _is_as_asked(node: Node, message: ParameterMessage) -> bool:
    """Whether a parameter has the wanted value already: also one that is fixed, so a file of what is can be loaded.

    `ros2 param load` guesses the type of a value from its text: 1e-05, nan and what is not set arrive as words, an
    empty array as one of bool. So what the present value would arrive as counts as well.
    """
    if not node.has_parameter(message.name):
        return False
    present = node.get_parameter(message.name)
    return message.value in (present.get_parameter_value(), get_parameter_value(str(_plain(present.value))))


def _parameter(node: Node, message: ParameterMessage) -> Parameter:
    """Parameter of a message; ValueError names what is invalid."""
    name, kind = message.name, message.value.type
    if not node.has_parameter(name):  # rclpy checks too, but accepts an empty name
        raise ValueError(f"{name[:SHOWN]!r}: no such parameter; `ros2 param list` names them all")
    if name == CLOCK:
        raise ValueError(f"{CLOCK}: fixed at start, since all stamps hang on the clock; restart the node")
    if kind not in SETTABLE:
        raise ValueError(f"{name}: found the type {kind}, wanted one of rcl_interfaces/msg/ParameterType, 1 to 9")
    if (declared := node.describe_parameter(name)).read_only:
        why = declared.additional_constraints.partition(ONLY)[2] or SETUP
        raise ValueError(f"{name}: fixed at start, since {why}; restart the node")
    return _as_declared(Parameter.from_parameter_msg(message), node.get_parameter(name).type_)


def _as_declared(found: Parameter, declared: Parameter.Type) -> Parameter:
    """Parameter of the declared type, where whole numbers are given for floats."""
    if (found.type_, declared) == (Parameter.Type.INTEGER, Parameter.Type.DOUBLE):
        return Parameter(found.name, declared, float(found.value))
    if (found.type_, declared) == (Parameter.Type.INTEGER_ARRAY, Parameter.Type.DOUBLE_ARRAY):
        return Parameter(found.name, declared, [float(one) for one in found.value])
    return found
