"""The thread of the thruster output, on a bus whose time goes on as the test says, with a PCA9685 at its far end."""

import threading
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any

import pytest

from hindrax_core import vehicle
from hindrax_core.bus_operations import DeviceError, Transaction
from hindrax_core.driver_interface import Output
from hindrax_core.events import Stamp, after, seconds_between, stamp_from_s
from hindrax_core.signals import AppliedOutput, Command
from hindrax_drivers.buses.clock import Meanwhile, nothing
from hindrax_drivers.devices.pca9685 import Pca9685
from hindrax_drivers.output.enable_line import EnableLine
from hindrax_drivers.output.output_guard import ArmingPhase, OutputGuard, OutputGuardKnobs, RefusedCommand, Request
from hindrax_drivers.output.output_ports import RegisterOutput
from hindrax_drivers.output.output_reasons import NO_REASON, OutputReason, output_reason
from hindrax_drivers.output.output_thread import OutputThread
from hindrax_sim.buses.virtual_i2c import VirtualI2c
from hindrax_sim.devices.pca9685 import Pca9685 as Emulator
from hindrax_sim.testing.lock_step import LockStep

START = stamp_from_s(100.0)
PATIENT_S = 30.0
NEUTRAL, MOVING = (1500.0,) * 8, (1600.0,) * 8
WHY = output_reason(OutputReason.LIFECYCLE, state="inactive on request")
GONE = output_reason(OutputReason.UNNAMED, sentence="the pilot has gone")
NO_BUS = "no bus here; check the port"


class SteppedBus(LockStep):
    """Time goes on only as the test says, but for the short waits of a set-up; a sleeper can be woken."""

    def __init__(self, wires: VirtualI2c) -> None:
        super().__init__(wires, START)
        self._changed = threading.Condition()
        self._woken = False
        self.trouble = ""

    def sleep_until(self, stamp: Stamp, readable: int | None = None, meanwhile: Meanwhile = nothing) -> None:
        del readable
        meanwhile()
        with self._changed:
            if seconds_between(self.time, stamp) < 0.001:
                self.time = max(self.time, stamp)
                return
            self._changed.wait_for(lambda: self._woken or self.trouble or self.time >= stamp, PATIENT_S)
            self._woken, trouble, self.trouble = False, self.trouble, ""
        if trouble:
            raise DeviceError(trouble)

    def wake(self) -> None:
        with self._changed:
            self._woken = True
            self._changed.notify_all()

    def advance(self, seconds: float) -> None:
        with self._changed:
            self.time = after(self.time, seconds)
            self._changed.notify_all()

    def transfer(self, transaction: Transaction) -> bytes:
        with self._changed:
            return super().transfer(transaction)


class Bench:
    """The thread with its output, and what it tells."""

    def __init__(self) -> None:
        self.chip, wires = Emulator(), VirtualI2c()
        wires.attach(0x40, self.chip)
        self.bus = SteppedBus(wires)
        self.driver = Pca9685((*range(8), 8, 9), (1500.0,) * 8 + (1100.0,) * 2, vehicle.Output())
        self.there, self.beats, self.sequence = True, 0, 0
        self.told: list[AppliedOutput] = []
        self.troubles: list[str] = []
        self.frames: list[bool] = []
        self.on_idle: Callable[[], None] = lambda: None
        self.thread = OutputThread(
            self.open, OutputGuard((1500.0,) * 8, 2, OutputGuardKnobs(arming_s=0.5)), self, self.beat
        )

    def open(self) -> RegisterOutput:
        if not self.there:
            raise DeviceError(NO_BUS)
        return RegisterOutput(self.bus, self.driver, EnableLine(), lambda _stamp, sent, _data: self.frames.append(sent))

    def beat(self) -> None:
        self.beats += 1

    def applied(self, applied: AppliedOutput) -> None:
        self.told.append(applied)

    def refused(self, refusal: RefusedCommand, stamp: Stamp) -> None:
        raise AssertionError(f"{refusal.text} at {stamp}")

    def found(self, identity: str) -> None:
        assert identity.startswith("PCA9685")

    def troubled(self, text: str) -> None:
        self.troubles.append(text)

    def deliver(self, outputs: Iterable[Output]) -> None:
        raise AssertionError(outputs)

    def until(self, done: Callable[[], Any], step_s: float = 0.01) -> None:
        """Let time pass until it is so."""
        deadline, turned = time.monotonic() + PATIENT_S, threading.Event()
        while not done():
            assert time.monotonic() < deadline
            self.bus.advance(step_s)
            turned.wait(0.001)

    def makes(self, pulses: tuple[float, ...]) -> bool:
        """Whether the chip makes these pulses of thrusters, or of thrusters and lamps."""
        return self.chip.pulses_us()[: len(pulses)] == pytest.approx(self.driver.applied(pulses))

    def request(self) -> Request:
        """A request later than all before it."""
        self.sequence += 1
        self.bus.advance(1e-6)
        return Request(self.bus.now(), self.sequence)

    def fly(self) -> bool:
        """Command a motion, once more."""
        self.sequence += 1
        self.thread.command(Command(MOVING, (), self.bus.now(), self.sequence))
        self.answered()
        return self.makes(MOVING)

    def answered(self) -> None:
        """Wait until the thread has taken every order: to arm twice is to arm once."""
        self.thread.arm(self.request()).result(PATIENT_S)


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench()
    yield made
    made.thread.stop()
    assert made.thread.failure is None


def test_every_order_reaches_the_guard_at_once_and_the_end_is_neutral(bench: Bench) -> None:
    bench.thread.start()
    bench.until(lambda: bench.thread.ready)
    assert bench.thread.now == bench.bus.now()
    assert bench.makes(NEUTRAL + (1100.0,) * 2)
    assert bench.thread.arm(bench.request()).result(PATIENT_S).accepted
    bench.until(bench.fly)
    bench.thread.light((1.0, 0.0))
    bench.until(lambda: bench.makes((*MOVING, 1900.0, 1100.0)), 0.0)
    bench.thread.drop(GONE)
    bench.until(lambda: bench.told[-1].reason == GONE, 0.0)
    assert bench.told[-1].phase is ArmingPhase.DISARMED
    assert bench.thread.arm(bench.request()).result(PATIENT_S).accepted
    bench.until(bench.fly)
    assert bench.thread.disarm(bench.request()).result(PATIENT_S).accepted
    bench.until(lambda: bench.told[-1].reason == output_reason(OutputReason.REQUEST), 0.0)
    assert bench.thread.arm(bench.request()).result(PATIENT_S).accepted
    bench.until(bench.fly)
    bench.thread.stop(PATIENT_S)
    assert bench.makes(NEUTRAL)
    assert not bench.thread.ready
    assert bench.thread.now == Stamp(0)


def test_an_output_that_is_not_there_is_reported_and_not_armed_until_it_comes(bench: Bench) -> None:
    bench.there = False
    bench.thread.start()
    bench.thread.command(Command(MOVING, (), bench.bus.now(), 1))
    bench.thread.light((1.0, 1.0))
    bench.thread.drop(WHY)
    assert not bench.thread.ready
    assert bench.thread.now == Stamp(0)
    answer = bench.thread.arm(bench.request()).result(PATIENT_S)
    assert (answer.accepted, answer.reason) == (False, NO_BUS)
    assert bench.troubles[0] == NO_BUS
    bench.there = True
    bench.until(lambda: bench.thread.ready)
    assert bench.thread.arm(bench.request()).result(PATIENT_S).accepted


def test_an_inhibition_from_before_the_output_was_open_holds_until_it_ends(bench: Bench) -> None:
    bench.there = False
    bench.thread.start()
    bench.thread.inhibit(WHY)
    assert bench.thread.arm(bench.request()).result(PATIENT_S).reason == NO_BUS
    bench.there = True
    bench.until(lambda: bench.thread.ready)
    assert bench.thread.arm(bench.request()).result(PATIENT_S).reason == str(WHY)
    bench.thread.inhibit(NO_REASON)
    assert bench.thread.arm(bench.request()).result(PATIENT_S).accepted
    bench.thread.inhibit(WHY)
    bench.until(lambda: bench.told[-1].reason == WHY, 0.0)


def test_it_beats_ten_times_a_second_of_the_output_and_at_once_when_that_went_back(bench: Bench) -> None:
    bench.thread.start()
    bench.until(lambda: bench.thread.ready)

    def beats(seconds: float) -> int:
        end, before = after(bench.bus.now(), seconds), bench.beats

        def passed() -> bool:
            # Each step of the time is answered, so that none is missed on a busy machine.
            bench.thread.disarm(bench.request()).result(PATIENT_S)
            return bench.bus.now() >= end

        bench.until(passed)
        return bench.beats - before

    assert 9 <= beats(1.0) <= 11
    still = bench.beats
    for _ in range(20):
        bench.thread.disarm(bench.request()).result(PATIENT_S)
    assert bench.beats == still, "hardly any time has passed"
    for count, back_s in enumerate((50.0, 0.5), start=1):
        bench.bus.advance(-back_s)
        bench.thread.disarm(bench.request()).result(PATIENT_S)
        assert bench.beats == still + count


def test_a_clock_that_fails_is_a_fault_that_is_reported_and_ends(bench: Bench) -> None:
    bench.thread.start()
    bench.until(lambda: bench.thread.ready)
    bench.bus.trouble = "the clock is gone"
    bench.until(lambda: "the clock is gone" in bench.troubles)
    assert any((one.phase, one.reason) == (ArmingPhase.FAULTED, "the clock is gone") for one in bench.told)
    bench.until(lambda: bench.told[-1].phase is ArmingPhase.DISARMED)


def test_who_asks_while_it_ends_gets_an_answer(bench: Bench) -> None:
    asked: list[Any] = []
    bench.thread.start()
    bench.until(lambda: bench.thread.ready)
    bench.on_idle = lambda: asked.append(bench.thread.disarm(bench.request()))
    bench.until(lambda: asked)
    bench.thread.stop(PATIENT_S)
    assert all(one.done() for one in asked)
    assert not asked[-1].result().accepted


def test_every_transaction_is_tapped_as_what_was_sent_and_what_came(bench: Bench) -> None:
    bench.thread.start()
    bench.until(lambda: bench.thread.ready)
    bench.thread.stop(PATIENT_S)
    assert len(bench.frames) >= 10
    assert bench.frames == [True, False] * (len(bench.frames) // 2)
