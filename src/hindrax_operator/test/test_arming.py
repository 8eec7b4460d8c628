"""The wait for arming ends as soon as the thrusters do not arm any more, and arming with the wait."""

from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs", reason="needs the built workspace: run ./hindrax test")

from hindrax_core.errors import HindraxError
from hindrax_operator.nodes.operator_node import Operator
from hindrax_ros.messages.convert import stamp_to_msg

DISARMED, ARMING, ARMED = "disarmed", "arming", "armed"


class OperatorOf(Operator):
    """One who is told these states, each with the time of its message [s]."""

    def __init__(self, *states: tuple[float, str]) -> None:
        self.thrusters: Any = None
        self._mock = False
        self.asked: list[bool] = []
        self._states: Iterator[tuple[float, str]] = iter(states)
        self.spin()

    def wait_for_thrusters(self) -> None: ...

    def _request_arming(self, *, arm: bool) -> Any:
        self.asked.append(arm)
        return SimpleNamespace(accepted=True, reason="")

    def spin(self, _seconds: float = 0.0) -> None:
        at_s, state = next(self._states)
        header = SimpleNamespace(stamp=stamp_to_msg(int(at_s * 1e9)))
        reason = "" if state == ARMED else "chip lost"
        self.thrusters = SimpleNamespace(state=state, armed=state == ARMED, reason=reason, header=header)


@pytest.mark.parametrize(
    "states",
    [
        [(1.0, DISARMED), (1.1, ARMING), (1.2, DISARMED)],
        [(1.0, DISARMED), (1.1, DISARMED), (2.2, DISARMED)],
    ],
    ids=["after it began", "before that could be seen"],
)
def test_who_stopped_arming_is_not_waited_for(states: list[tuple[float, str]]) -> None:
    with pytest.raises(HindraxError, match=r"^the thrusters stopped arming: chip lost$"):
        OperatorOf(*states).arm(seconds=60.0)


def test_what_the_thrusters_said_before_the_answer_ends_no_wait() -> None:
    OperatorOf((1.0, DISARMED), (1.1, DISARMED), (1.9, DISARMED), (2.0, ARMING), (9.0, ARMED)).arm(seconds=60.0)


@pytest.mark.parametrize("given_up", [KeyboardInterrupt(), HindraxError("waited 60 s for the thrusters")])
def test_who_gives_up_does_not_leave_them_arming(monkeypatch: pytest.MonkeyPatch, given_up: BaseException) -> None:
    operator = OperatorOf((1.0, DISARMED), (1.1, ARMING), (1.2, ARMING))

    def wait(*_: object) -> None:
        operator.spin()
        raise given_up

    monkeypatch.setattr(operator, "wait", wait)
    with pytest.raises(type(given_up)):
        operator.arm(seconds=60.0)
    assert operator.asked == [True, False]


def test_disarming_that_lasts_too_long_is_asked_for_once() -> None:
    operator = OperatorOf((1.0, ARMED), (1.1, ARMED), (1.2, ARMED))
    with pytest.raises(HindraxError, match="waited 0 s for the thrusters, which are armed"):
        operator.arm(arm=False, seconds=0.0)
    assert operator.asked == [False]
