"""The thruster output in lock-step, under every fault of its bus: what is on the wire, whatever happens."""

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import pytest

from hindrax_bringup.share_files import default_vehicle
from hindrax_core import vehicle
from hindrax_core.bus_operations import Transaction, Write
from hindrax_core.driver_interface import Output
from hindrax_core.events import Stamp, after, seconds_between, stamp_from_s
from hindrax_core.signals import AppliedOutput, Command
from hindrax_core.text.refusals import Reason, Refusal
from hindrax_drivers.buses.clock import Meanwhile, nothing
from hindrax_drivers.devices.pca9685 import LED0, Pca9685
from hindrax_drivers.output.enable_line import EnableLine
from hindrax_drivers.output.output_guard import (
    Answer,
    ArmingPhase,
    OutputGuard,
    OutputGuardKnobs,
    RefusedCommand,
    Request,
)
from hindrax_drivers.output.output_host import OutputHost
from hindrax_drivers.output.output_ports import RegisterOutput
from hindrax_drivers.output.output_reasons import NEW, NO_REASON, OutputReason, output_reason
from hindrax_sim.buses.virtual_i2c import VirtualI2c
from hindrax_sim.devices.pca9685 import Pca9685 as Emulator
from hindrax_sim.faults.fault_registry import FAULTS, FaultSpec, with_bus_faults
from hindrax_sim.testing.lock_step import LockStep

START = stamp_from_s(100.0)
REST = (1500.0,) * 8 + (1100.0,) * 2
NEUTRAL, MOVING = (1500.0,) * 8, (1600.0,) * 8
KNOBS = OutputGuardKnobs(arming_s=0.5)
LASTS_S = 6.0
HINDRAX = vehicle.load_vehicle(default_vehicle())
FAULTS_OF_THE_BUS = [name for name, kind in FAULTS.items() if "thrusters" in kind.devices(HINDRAX)]


class Line(EnableLine):
    def __init__(self) -> None:
        self.enabled, self.writes, self.closed = False, 0, False

    def written(self) -> None:
        self.writes += 1

    def set(self, *, enabled: bool) -> None:
        self.enabled = enabled

    def close(self) -> None:
        self.closed = True


class GarblingBus(LockStep):
    """A bus on which a burst to the channels can lose a bit, unnoticed by either side."""

    garbles = closed = False

    def close(self) -> None:
        self.closed = True

    def sleep_until(self, stamp: Stamp, readable: int | None = None, meanwhile: Meanwhile = nothing) -> None:
        meanwhile()
        super().sleep_until(stamp, readable)

    def transfer(self, transaction: Transaction) -> bytes:
        if self.garbles and isinstance(transaction, Write) and transaction.data[0] == LED0:
            self.garbles = False
            transaction = replace(transaction, data=transaction.data[:-1] + bytes([transaction.data[-1] ^ 1]))
        return super().transfer(transaction)


class Flight:
    """Host, guard, driver, chip; commands every 20 ms. Tells what it heard and what was on the wire."""

    def __init__(self, specs: Iterable[FaultSpec] = ()) -> None:
        self.chip, self.line = Emulator(), Line()
        afflicted = with_bus_faults("thrusters", self.chip, list(specs), seed=5, start_s=100.0)
        wires = VirtualI2c()
        wires.attach(0x40, afflicted(self.chip))
        self.bus = GarblingBus(wires, START)
        self.driver = Pca9685((*range(8), 8, 9), REST, vehicle.Output())
        self.told: list[AppliedOutput] = []
        self.refusals: list[str] = []
        self.troubles: list[str] = []
        self.identities: list[str] = []
        self.frames = 0
        output = RegisterOutput(self.bus, self.driver, self.line, self.tap)
        self.host = OutputHost(output, OutputGuard((1500.0,) * 8, 2, KNOBS), self)
        self.sequence = 0
        self.requests = 0

    def tap(self, _stamp: Stamp, _sent: bool, _data: bytes) -> None:
        self.frames += 1

    def applied(self, applied: AppliedOutput) -> None:
        self.told.append(applied)

    def refused(self, refusal: RefusedCommand, _stamp: Stamp) -> None:
        self.refusals.append(refusal.fault)

    def found(self, identity: str) -> None:
        self.identities.append(identity)

    def troubled(self, text: str) -> None:
        self.troubles.append(text)

    def deliver(self, _outputs: Iterable[Output]) -> None:
        raise AssertionError("a register says nothing by itself")

    def on_idle(self) -> None:
        pass

    @property
    def phase(self) -> str:
        return self.told[-1].phase

    def wire(self) -> tuple[float | None, ...]:
        return self.chip.pulses_us()[:8]

    def elapsed_s(self) -> float:
        return seconds_between(START, self.bus.now())

    def run(self, seconds: float, pulses: tuple[float, ...] | None = MOVING) -> None:
        end = after(self.bus.now(), seconds)
        while self.bus.now() < end:
            if pulses is not None:
                self.sequence += 1
                self.host.command(Command(pulses, (), self.bus.now(), self.sequence))
            slot = after(self.bus.now(), 0.02)
            while (due := self.host.turn()) < slot:
                self.bus.sleep_until(max(due, after(self.bus.now(), 0.0001)))
            self.bus.sleep_until(slot)

    def arm(self) -> Answer:
        self.requests += 1
        return self.host.arm(Request(self.bus.now(), self.requests))

    def armed(self) -> "Flight":
        self.run(0.1)
        assert self.arm().accepted
        self.run(0.8)
        assert self.phase is ArmingPhase.ARMED
        assert self.wire() == pytest.approx(self.driver.applied(MOVING))
        return self

    def neutral(self) -> Any:
        return pytest.approx(self.driver.applied(NEUTRAL))


def test_neutral_before_anything_else() -> None:
    flight = Flight()
    flight.host.turn()
    assert flight.wire() == flight.neutral()
    assert flight.line.enabled
    assert (flight.phase, flight.told[-1].reason) == (ArmingPhase.DISARMED, NEW)
    assert [one.split(":")[0] for one in flight.identities] == ["PCA9685 at 0x40"]


def test_lamps_are_lit_in_the_turn_that_follows() -> None:
    flight = Flight()
    flight.run(0.1)
    flight.host.light((1.0, 0.0))
    flight.host.turn()
    assert flight.chip.pulses_us()[8:10] == pytest.approx(flight.driver.applied((1900.0, 1100.0)))


def test_silence_is_neutral_on_the_wire_in_the_time_promised_and_stays_so() -> None:
    flight = Flight().armed()
    last_s = flight.elapsed_s() - 0.02
    flight.run(6.0, None)
    changes = [change for change in flight.chip.changes if change.now_s > 100.0 + last_s + 1e-6]
    assert [change.pulses_us[:8] for change in changes] == [flight.neutral()]
    assert changes[0].now_s - 100.0 - last_s <= KNOBS.silence_s
    assert flight.phase is ArmingPhase.DISARMED


def test_neutral_is_repeated_at_ten_hertz_or_more() -> None:
    flight = Flight()
    flight.run(0.1, None)
    before, frames = len(flight.told), flight.frames
    flight.run(5.0, None)
    writes, checks = len(flight.told) - before, 6
    assert writes >= 50
    assert (flight.frames - frames) / 2 <= writes + 3 * checks, "the rest of the bus is for others"


def test_the_timer_of_the_enable_line_is_triggered_in_time_while_the_output_is_served_and_only_then() -> None:
    flight = Flight().armed()
    for pulses in (MOVING, NEUTRAL, None):
        for _ in range(30):
            before = flight.line.writes
            flight.run(0.2, pulses)
            assert flight.line.writes - before >= 2, "a timer of 0.3 s would run out"
    before = flight.line.writes
    flight.bus.sleep_until(after(flight.bus.now(), 1.0))  # frozen
    assert flight.line.writes == before


@pytest.mark.parametrize("bad", [math.nan, math.inf, 0.0, 65535.0])
def test_what_is_no_pulse_is_neutral_at_once(bad: float) -> None:
    flight = Flight().armed()
    flight.run(0.02, (bad,) * 8)
    assert flight.wire() == flight.neutral()
    assert flight.refusals[-1] == "not a pulse"


def test_the_end_is_neutral() -> None:
    flight = Flight().armed()
    flight.host.end()
    assert flight.wire() == flight.neutral()
    assert (flight.line.closed, flight.bus.closed) == (True, True)


def test_an_end_without_neutral_is_reported_and_bus_and_line_are_given_back() -> None:
    flight = Flight([FaultSpec("absent", ("thrusters",), 2.0, 3.0)]).armed()
    flight.run(2.1 - flight.elapsed_s())
    flight.troubles.clear()
    flight.host.end()
    assert len(flight.troubles) > 1, "tried again"
    assert all("neutral at the end: " in text and "no acknowledge" in text for text in flight.troubles)
    assert (flight.line.closed, flight.bus.closed) == (True, True)


def test_disarm_is_neutral() -> None:
    flight = Flight().armed()
    assert flight.host.disarm(Request(flight.bus.now(), 99)).accepted
    flight.host.turn()
    assert flight.wire() == flight.neutral()
    flight.run(1.0)
    assert flight.wire() == flight.neutral()


def test_what_is_reported_is_what_is_on_the_wire() -> None:
    flight = Flight().armed()
    for pulse in (1234.0, 1777.0, 1500.0):
        flight.run(0.5, (pulse,) * 8)
        assert flight.told[-1].pulses_us == pytest.approx(flight.wire())
        assert flight.told[-1].sequence == flight.sequence
    assert flight.frames >= 2 * len(flight.told)


@pytest.mark.parametrize("fault", FAULTS_OF_THE_BUS)
def test_a_fault_is_survived_and_nobody_is_armed_by_it(fault: str) -> None:
    flight = Flight([FaultSpec(fault, ("thrusters",), 2.0, LASTS_S)]).armed()
    flight.run(2.0 + LASTS_S - flight.elapsed_s())
    assert flight.troubles
    flight.run(2.0)
    faulted = any(one.phase is ArmingPhase.FAULTED for one in flight.told)
    assert flight.phase is (ArmingPhase.DISARMED if faulted else ArmingPhase.ARMED)
    wanted = NEUTRAL if faulted else MOVING
    assert flight.wire() == pytest.approx(flight.driver.applied(wanted))
    silent_since = len(flight.troubles)
    flight.run(1.0)
    assert len(flight.troubles) == silent_since
    assert flight.arm().accepted
    flight.run(0.8)
    assert flight.wire() == pytest.approx(flight.driver.applied(MOVING))


def test_writes_that_fail_for_a_moment_are_reported_and_the_flight_goes_on() -> None:
    flight = Flight([FaultSpec("absent", ("thrusters",), from_s, 0.1) for from_s in (2.1, 2.6)]).armed()
    flight.run(3.0 - flight.elapsed_s())
    assert len(flight.troubles) >= 6
    assert all("no acknowledge" in text for text in flight.troubles)
    assert {one.phase for one in flight.told[-40:]} == {ArmingPhase.ARMED}


def test_pulses_that_a_bad_line_has_changed_are_written_again_before_anybody_is_disarmed() -> None:
    flight = Flight().armed()
    flight.bus.sleep_until(after(flight.bus.now(), 1.0))  # a write and a check are due together
    flight.bus.garbles = True
    flight.host.turn()
    assert ["channels read back" in text for text in flight.troubles] == [True]
    assert flight.wire() == flight.neutral()
    assert flight.phase is ArmingPhase.ARMED


@pytest.mark.parametrize("fault", ["absent", "bus_stuck"])
def test_an_output_that_cannot_be_reached_is_faulted_and_its_outputs_are_disabled(fault: str) -> None:
    flight = Flight([FaultSpec(fault, ("thrusters",), 2.1, 2.9)]).armed()
    flight.run(2.5 - flight.elapsed_s())
    assert flight.phase is ArmingPhase.FAULTED
    assert any("faulted" in one.phase and one.reason in flight.troubles for one in flight.told)
    assert not flight.line.enabled
    answer = flight.arm()
    assert not answer.accepted
    assert "output is faulted" in answer.reason
    flight.run(4.0)
    assert flight.line.enabled
    assert flight.phase is ArmingPhase.DISARMED


def test_a_lost_supply_is_found_within_a_second_and_pulses_come_back_neutral_and_disarmed() -> None:
    flight = Flight().armed()
    flight.chip.power_cycle(100.0 + flight.elapsed_s())
    flight.run(1.2)
    assert flight.wire() == flight.neutral()
    assert flight.phase is ArmingPhase.DISARMED
    assert "its supply was lost" in flight.told[-1].reason


def test_an_absent_output_is_found_when_it_comes() -> None:
    flight = Flight([FaultSpec("absent", ("thrusters",), 0.0, 3.0)])
    flight.run(2.9)
    assert flight.phase is ArmingPhase.FAULTED
    assert "no acknowledge" in flight.told[-1].reason
    assert 3 <= len(flight.troubles) <= 7, "looked for now and then, not in every turn"
    assert flight.host.turn() > flight.bus.now()
    flight.run(1.0)
    assert flight.wire() == flight.neutral()
    flight.armed()


def test_an_absent_output_is_not_asked_before_it_is_looked_for_again() -> None:
    flight = Flight([FaultSpec("absent", ("thrusters",), 0.0, 30.0)])
    flight.run(2.1)
    for looked_for in range(len(flight.troubles), len(flight.troubles) + 5):
        assert len(flight.troubles) == looked_for
        flight.bus.sleep_until(flight.host.turn())
        flight.host.turn()


WHY = output_reason(OutputReason.LIFECYCLE, state="inactive on request")


def test_inhibited_is_neutral_disarmed_and_obeys_nobody_until_it_ends() -> None:
    flight = Flight().armed()
    flight.host.inhibit(WHY)
    flight.host.turn()
    assert flight.wire() == flight.neutral()
    refused = len(flight.refusals)
    flight.run(1.0)
    commanded = len(flight.refusals)
    flight.host.light((1.0, 1.0))
    assert flight.wire() == flight.neutral()
    assert commanded - refused >= 50
    assert flight.refusals[refused:] == ["inhibited"] * (commanded - refused + 1)
    assert flight.arm() == Answer(accepted=False, reason=Refusal(Reason.INHIBITED, WHY))
    assert flight.phase is ArmingPhase.DISARMED
    flight.host.inhibit(NO_REASON)
    flight.run(0.1)
    assert flight.wire() == flight.neutral()
    flight.armed()


def test_a_command_that_waits_is_not_written_after_the_inhibition() -> None:
    flight = Flight().armed()
    changes = len(flight.chip.changes)
    flight.host.command(Command((1700.0,) * 8, (), flight.bus.now(), flight.sequence + 1))
    flight.host.inhibit(WHY)
    flight.host.turn()
    assert [change.pulses_us[:8] for change in list(flight.chip.changes)[changes:]] == [flight.neutral()]


def test_an_inhibition_ends_arming_and_outlasts_a_fault_of_the_bus() -> None:
    flight = Flight([FaultSpec("absent", ("thrusters",), 2.0, 2.0)])
    flight.run(0.1)
    assert flight.arm().accepted
    flight.host.inhibit(WHY)
    flight.run(5.0)
    assert {one.phase for one in flight.told[3:]} <= {ArmingPhase.DISARMED, ArmingPhase.FAULTED, ArmingPhase.ARMING}
    assert flight.phase is ArmingPhase.DISARMED
    assert flight.wire() == flight.neutral()
    assert flight.arm() == Answer(accepted=False, reason=Refusal(Reason.INHIBITED, WHY))
