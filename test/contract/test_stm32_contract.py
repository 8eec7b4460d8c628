"""The STM32 driver against the firmware on its emulated board, over a line with a speed."""

from collections.abc import Iterable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_core.driver_interface import Output, Send, Trouble
from hindrax_core.events import Stamped, stamp_from_s
from hindrax_core.readings import AppliedPulses, Battery
from hindrax_drivers.devices.stm32 import Stm32
from hindrax_sim.devices.stm32 import Stm32 as Emulator

CHANNELS = (*range(8), 8, 9)
REST = (1500.0,) * 8 + (1100.0,) * 2
FULL = (1900.0,) * 10
STEP_S = 0.01


class Bench:
    """Both ends of the line, in steps of 10 ms."""

    def __init__(self) -> None:
        self.now_s = 50.0
        self.board, self.driver = Emulator(now_s=50.0), Stm32(CHANNELS)
        self.outputs: list[Output] = []
        self.wish: tuple[float, ...] | None = REST
        self.cut = False
        self.take(self.driver.start(stamp_from_s(self.now_s)))

    def take(self, outputs: Iterable[Output]) -> None:
        for output in outputs:
            if isinstance(output, Send) and not self.cut:
                self.answer(self.board.receive(output.data, self.now_s))
            self.outputs.append(output)

    def answer(self, data: bytes) -> None:
        if data and not self.cut:
            self.take(self.driver.feed(data, stamp_from_s(self.now_s)))

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / STEP_S)):
            self.now_s += STEP_S
            stamp = stamp_from_s(self.now_s)
            if self.wish is not None:
                self.take([self.driver.override(self.wish, stamp)])
            self.answer(self.board.step(self.now_s))
            self.take(self.driver.tick(stamp))

    def arm(self) -> None:
        self.take([self.driver.arm(stamp_from_s(self.now_s))])
        self.run(0.1)

    def troubles(self) -> list[str]:
        return [output.text for output in self.outputs if isinstance(output, Trouble)]


def armed() -> Bench:
    bench = Bench()
    bench.run(7.1)
    bench.arm()
    assert bench.driver.armed
    return bench


def test_finds_the_board_within_a_second() -> None:
    bench = Bench()
    bench.run(1.0)
    assert bench.driver.ready
    assert bench.troubles() == []


def test_arms_after_neutral_and_not_before() -> None:
    bench = Bench()
    bench.run(3.0)
    bench.arm()
    assert not bench.driver.armed
    assert "neutral for" in bench.driver.refusal
    bench.run(4.2)
    bench.arm()
    assert bench.driver.armed
    assert bench.board.armed


@settings(max_examples=20, deadline=None)
@given(st.lists(st.integers(1100, 1900), min_size=10, max_size=10))
def test_pulses_wanted_are_pulses_seen_and_pulses_reported(pulses: list[int]) -> None:
    bench = armed()
    bench.wish = tuple(map(float, pulses))
    bench.run(0.2)
    assert bench.board.pulses_us()[:10] == bench.wish
    reported = [one.reading for one in bench.outputs if isinstance(one, Stamped)]
    assert [one for one in reported if isinstance(one, AppliedPulses)][-1] == AppliedPulses(bench.wish)


def test_a_driver_that_is_not_asked_any_more_falls_silent_and_the_board_goes_neutral() -> None:
    bench = armed()
    bench.wish = FULL
    bench.run(0.1)
    bench.wish = None
    bench.run(0.15)
    assert bench.board.pulses_us()[:8] == FULL[:8]
    bench.run(0.36)
    assert bench.board.pulses_us()[:8] == REST[:8]


def test_a_cut_line_is_neutral_within_the_time_of_the_firmware_then_disarmed() -> None:
    bench = armed()
    bench.wish = FULL
    bench.run(0.1)
    bench.cut = True
    bench.run(0.31)
    assert bench.board.pulses_us()[:8] == REST[:8]
    bench.run(2.0)
    assert not bench.board.armed
    bench.cut = False
    bench.run(1.2)
    assert not bench.driver.armed
    assert bench.board.pulses_us()[:8] == REST[:8]


def test_a_board_that_resets_boots_disarmed_and_the_driver_notices() -> None:
    bench = armed()
    bench.wish = FULL
    bench.run(0.1)
    bench.board.power_cycle(bench.now_s)
    assert bench.board.pulses_us()[:8] == REST[:8]
    bench.run(1.2)
    assert not bench.driver.armed
    assert any("has disarmed itself" in text for text in bench.troubles())


def test_something_else_on_the_line_is_reported() -> None:
    bench = Bench()
    bench.board.disguise(True)
    bench.run(6.0)
    assert not bench.driver.ready
    assert any("none of them verify" in text for text in bench.troubles())


def test_battery() -> None:
    bench = Bench()
    bench.board.set_truth(Battery(14.8), 0.0)
    bench.run(1.2)
    found = [one.reading for one in bench.outputs if isinstance(one, Stamped) and isinstance(one.reading, Battery)]
    assert found[0].voltage_V == pytest.approx(14.8)
