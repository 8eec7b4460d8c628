"""The guided known-weight test against a stack that pushes as a vehicle under the load would."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import pytest

from hindrax_analysis.identification.known_weight import weigh
from hindrax_bringup.share_files import default_vehicle
from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamp, Stamped, after, stamp_from_s
from hindrax_core.vehicle import load_vehicle
from hindrax_operator.nodes import orders
from hindrax_operator.weighing import HOLD_S, SETTLE_S, weigh_on
from hindrax_ros.messages.convert import stamp_to_msg

VEHICLE = load_vehicle(default_vehicle())
LOADS = (0.0, 15.0, -15.0)
GAIN = 0.95
FORCES_N = [float(n) for n in range(8)]


class PushingStack:
    """An operator's view of a vehicle that keeps its place; every spin is a tenth of a second."""

    def __init__(self) -> None:
        self.thrusters, self.unobeyed = SimpleNamespace(armed=True, state="armed", reason=""), ""
        self.load, self._now, self.asked = 0.0, stamp_from_s(50.0), 0

    def now(self) -> Stamp:
        return self._now

    @property
    def armed(self) -> bool:
        return bool(self.thrusters.armed)

    @property
    def allocation(self) -> Any:
        header = SimpleNamespace(stamp=stamp_to_msg(self._now))
        return SimpleNamespace(achieved=[-self.load / GAIN, 0.0, 0.0, 0.0, 0.0, 0.0], forces=FORCES_N, header=header)

    @property
    def navigation(self) -> Any:
        return Stamped(self._now, SimpleNamespace(velocity_mps=(0.0, 0.0, 0.0), rate_radps=(0.0, 0.0, 0.0)))

    def wait(self, done: Callable[[], bool], seconds: float, what: Callable[[], str]) -> None:
        spins = 0
        while not done():
            spins += 1
            assert spins < 10.0 * seconds, what()
            self._now = after(self._now, 0.1)


@pytest.fixture
def held(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    axes: list[str] = []
    monkeypatch.setattr(
        orders, "hold", lambda _operator, names, _value, *, engaged: axes.extend(names if engaged else [])
    )
    return axes


def test_it_holds_every_axis_asks_for_each_load_and_measures_when_it_hangs(held: list[str]) -> None:
    stack: Any = PushingStack()
    reported: list[str] = []

    def ready() -> bool:
        """The operator takes a moment."""
        stack.asked += 1
        return bool(stack.asked % 20 == 0)

    holds = weigh_on(
        stack, VEHICLE, 0, LOADS, ready=ready, ask=lambda load: setattr(stack, "load", load), report=reported.append
    )
    assert sorted(held) == ["depth", "heading", "pitch", "roll", "station"]
    assert [one.load for one in holds] == list(LOADS)
    assert all(len(one.thrust) == pytest.approx(10.0 * HOLD_S, abs=2) for one in holds)
    assert holds[1].begin_s > SETTLE_S + HOLD_S
    assert all(one.forces.tolist() == FORCES_N for one in holds)
    found = weigh(holds, 0, VEHICLE).gain
    assert found.positive == pytest.approx(GAIN, abs=1e-3)
    assert [line for line in reported if "keep away" in line]


def test_a_vehicle_that_is_disarmed_meanwhile_ends_it(held: list[str]) -> None:
    stack: Any = PushingStack()

    def disarm(_load: float) -> None:
        stack.thrusters = SimpleNamespace(armed=False, state="disarmed", reason="divergence: it does not turn")

    def never() -> bool:
        """It is told while the load is being hung: nobody has pressed Enter yet."""
        return False

    words = r"the weighing ended early: the thrusters are disarmed \(divergence: it does not turn\)"
    with pytest.raises(HindraxError, match=words):
        weigh_on(stack, VEHICLE, 0, LOADS, ready=never, ask=disarm, report=lambda _: None)
    assert held
