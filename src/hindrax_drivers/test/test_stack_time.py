"""A stack's time does not step with the wall clock, and says how far that has stepped."""

import itertools
import time
from dataclasses import dataclass

import pytest

from hindrax_core.stack_time import VARIABLE, StackTime, epoch_ns
from hindrax_drivers.buses.clock import SystemClock

S = 10**9


@dataclass
class Clocks:
    """Both clocks of a machine, in place of the real ones."""

    wall_ns: int = 1_700_000_000 * S
    steady_ns: int = 100 * S

    def run(self, seconds: int) -> None:
        self.wall_ns += seconds * S
        self.steady_ns += seconds * S


@pytest.fixture
def clocks(monkeypatch: pytest.MonkeyPatch) -> Clocks:
    made = Clocks()
    monkeypatch.setattr(time, "time_ns", lambda: made.wall_ns)
    monkeypatch.setattr(time, "monotonic_ns", lambda: made.steady_ns)
    return made


@pytest.mark.parametrize(("step_s", "how"), [(-3600, "back by 3600.0 s"), (86400 * 400, "forward by 34560000.0 s")])
def test_a_step_moves_no_stamp_and_is_reported(
    clocks: Clocks, monkeypatch: pytest.MonkeyPatch, step_s: int, how: str
) -> None:
    begin = clocks.wall_ns
    monkeypatch.setenv(VARIABLE, str(epoch_ns()))
    wire, stack = SystemClock(), StackTime(epoch_ns())
    clocks.run(5)
    assert (wire.now(), stack.now(), stack.step_reason()) == (begin + 5 * S, begin + 5 * S, "")
    clocks.wall_ns += step_s * S
    clocks.run(5)
    assert wire.now() == stack.now() == begin + 10 * S
    assert stack.step_reason() == f"the wall clock was set {how}"
    assert stack.step_s() == pytest.approx(step_s)
    wire.close()


def test_what_the_kernel_stamps_by_the_monotonic_clock_is_of_the_same_time(clocks: Clocks) -> None:
    stack, alone = StackTime(epoch_ns()), StackTime()
    clocks.wall_ns += S // 20
    assert stack.at(clocks.steady_ns) == stack.now(), "a step too small to restart for"
    assert alone.at(clocks.steady_ns) == alone.now()


def test_outside_of_a_stack_it_is_the_wall_clock(clocks: Clocks) -> None:
    alone = StackTime.of({})
    clocks.wall_ns += 3600 * S
    assert (alone.now(), alone.step_reason()) == (clocks.wall_ns, "")


def test_a_slewed_clock_has_not_stepped(clocks: Clocks) -> None:
    stack = StackTime.of({VARIABLE: str(epoch_ns())})
    clocks.wall_ns += S // 20
    assert stack.step_reason() == ""
    clocks.wall_ns += S // 4
    assert stack.step_reason() == "the wall clock was set forward by 0.3 s", "but so far it is not slewed"


@pytest.mark.parametrize("pauses_s", [{0: (2, 0)}, {0: (0, 2)}, {1: (2, 0)}, {1: (0, 2), 2: (2, 0)}])
def test_whoever_is_interrupted_between_the_two_clocks_sees_no_step(
    clocks: Clocks, monkeypatch: pytest.MonkeyPatch, pauses_s: dict[int, tuple[int, int]]
) -> None:
    stack, looks = StackTime(epoch_ns()), itertools.count()

    def wall_ns() -> int:
        before_s, after_s = pauses_s.get(next(looks), (0, 0))
        clocks.run(before_s)
        found = clocks.wall_ns
        clocks.run(after_s)
        return found

    monkeypatch.setattr(time, "time_ns", wall_ns)
    assert stack.step_s() == 0.0
