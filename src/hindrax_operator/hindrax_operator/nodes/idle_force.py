"""A larger idle force while an axis is weighed: a parameter of the pilot, set for as long, and set back."""

import contextlib
from collections.abc import Callable, Iterator
from typing import Any

from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters

from hindrax_core.errors import HindraxError
from hindrax_operator.nodes.operator_node import ANSWER_S, Operator

IDLE_FORCE = "allocation.idle_bias_N"


@contextlib.contextmanager
def idle_force_times(operator: Operator, times: float, report: Callable[[str], None]) -> Iterator[None]:
    """Multiply the idle force of the pilot's allocation for as long as this is entered.

    Where it cannot be had (a pilot without this parameter, a policy that does not allow it) a sentence is reported, and
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
            usual_N = None
            report(f"idle force left as it is ({error})")
    try:
        yield
    finally:
        if usual_N is not None:
            with contextlib.suppress(HindraxError):  # a stack that has ended forgets it
                _set_idle_force(operator, usual_N)


def _idle_force_N(operator: Operator) -> float:
    answer = _asked(operator, GetParameters, "pilot/get_parameters", GetParameters.Request(names=[IDLE_FORCE]))
    (found,) = answer.values
    if found.type != ParameterType.PARAMETER_DOUBLE:
        raise HindraxError(f"the pilot has no parameter {IDLE_FORCE}")
    return float(found.double_value)


def _set_idle_force(operator: Operator, force_N: float) -> None:
    value = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=force_N)
    request = SetParameters.Request(parameters=[Parameter(name=IDLE_FORCE, value=value)])
    (result,) = _asked(operator, SetParameters, "pilot/set_parameters", request).results
    if not result.successful:
        raise HindraxError(f"the pilot refused {IDLE_FORCE} {force_N:g}: {result.reason}")


def _asked(operator: Operator, kind: type[Any], service: str, request: object) -> Any:
    """Answer of a service; HindraxError where there is none in time."""
    client = operator.node.create_client(kind, service)
    try:
        operator.wait(client.service_is_ready, ANSWER_S, lambda: f"the pilot to offer {service}")
        future = client.call_async(request)
        operator.wait(future.done, ANSWER_S, lambda: f"an answer from {service}")
        return future.result()
    finally:
        operator.node.destroy_client(client)
