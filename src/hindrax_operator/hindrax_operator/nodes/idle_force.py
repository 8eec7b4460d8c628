"""A larger idle force while an axis is weighed: a parameter of the allocator, set for as long, and set back."""

import contextlib
from collections.abc import Callable, Iterator
from typing import TypeVar

from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.client import Client

from hindrax_core.errors import HindraxError
from hindrax_operator.nodes.operator_node import ANSWER_S, Operator

IDLE_FORCE = "idle_bias_N"
Answer = TypeVar("Answer")


@contextlib.contextmanager
def idle_force_times(operator: Operator, times: float, report: Callable[[str], None]) -> Iterator[None]:
    """Multiply the idle force of the allocator for as long as this is entered.

    Where it cannot be had (no allocator of ours, a policy that does not allow it) a sentence is reported, and
    nothing is changed: the weighing says by its deviation what that costs.

    Parameters
    ----------
    operator
        Of a running stack.
    times
        Of what is set.
    report
        Gets the sentence.
    """
    usual_N = None
    if times != 1.0:
        try:
            usual_N = _idle_force_N(operator)
            _set_idle_force(operator, times * usual_N)
        except HindraxError as error:
            report(f"idle force left as it is ({error})")
    try:
        yield
    finally:
        if usual_N is not None:  # also where no answer came: it may have been set
            with contextlib.suppress(HindraxError):  # a stack that has ended forgets it
                _set_idle_force(operator, usual_N)


def _idle_force_N(operator: Operator) -> float:
    client = operator.node.create_client(GetParameters, "allocator/get_parameters")
    (found,) = _asked(operator, client, GetParameters.Request(names=[IDLE_FORCE]), GetParameters.Response).values
    if found.type != ParameterType.PARAMETER_DOUBLE:
        raise HindraxError(f"the allocator has no parameter {IDLE_FORCE}")
    return float(found.double_value)


def _set_idle_force(operator: Operator, force_N: float) -> None:
    value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=force_N)
    request = SetParameters.Request(parameters=[Parameter(name=IDLE_FORCE, value=value)])
    client = operator.node.create_client(SetParameters, "allocator/set_parameters")
    (result,) = _asked(operator, client, request, SetParameters.Response).results
    if not result.successful:
        raise HindraxError(f"the allocator refused {IDLE_FORCE} {force_N:g}: {result.reason}")


def _asked(operator: Operator, client: Client, request: object, kind: type[Answer]) -> Answer:
    """Answer of a service; HindraxError where there is none in time."""
    try:
        operator.wait(client.service_is_ready, ANSWER_S, lambda: f"the allocator to offer {client.srv_name}")
        future = client.call_async(request)
        operator.wait(future.done, ANSWER_S, lambda: f"an answer from {client.srv_name}")
        answer = future.result()
        assert isinstance(answer, kind), "as its service answers"
        return answer
    finally:
        operator.node.destroy_client(client)
