"""The STM32 as an output behind the guard, over a pty, with the firmware at its far end."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest

from hindrax_core.driver_interface import Output
from hindrax_core.events import Stamp, Stamped, after, stamp_from_s, to_s
from hindrax_core.readings import Battery
from hindrax_drivers.buses.clock import Meanwhile, nothing
from hindrax_drivers.devices.stm32 import Stm32
from hindrax_drivers.output.output_guard import ArmingPhase, Command, OutputGuard, OutputGuardKnobs, Refusal, Request
from hindrax_drivers.output.output_host import AppliedOutput, OutputHost
from hindrax_drivers.output.output_ports import SerialOutput
from hindrax_sim.devices.stm32 import Stm32 as Emulator
from hindrax_sim.devices.stm32 import SupplyTruth
from hindrax_sim.ptys import Pty

CHANNELS = (*range(8), 8, 9)
NEUTRAL, MOVING = (1500.0,) * 8, (1601.0,) * 8
STEP_S = 0.005


class Bench:
    """A clock that lets the board run while the host sleeps."""

    def __init__(self, folder: Path) -> None:
        self.time = stamp_from_s(50.0)
        self.board = Emulator(now_s=50.0)
        self.pty: Pty | None = Pty(folder / "stm32")
        self.told: list[AppliedOutput] = []
        self.said: list[Output] = []
        self.troubles: list[str] = []
        self.frames: list[tuple[Stamp, bool, bytes]] = []
        output = SerialOutput(str(folder / "stm32"), Stm32(CHANNELS), self, self.tap)
        self.host = OutputHost(output, OutputGuard(8, 2, OutputGuardKnobs(arming_s=7.1)), self)
        self.sequence, self.mute, self.closed = 0, False, False

    def tap(self, stamp: Stamp, sent: bool, data: bytes) -> None:
        self.frames.append((stamp, sent, data))

    def now(self) -> Stamp:
        return self.time

    def sleep_until(self, stamp: Stamp, readable: int | None = None, meanwhile: Meanwhile = nothing) -> None:
        meanwhile()
        while self.time < stamp:
            self.time = after(self.time, STEP_S)
            if self.exchange(to_s(self.time)) and readable is not None:
                return

    def exchange(self, now_s: float) -> bool:
        """Let the board run; whether it has said something."""
        heard = b"" if self.pty is None else self.pty.read()
        data = self.board.receive(heard, now_s) + self.board.step(now_s)
        if self.pty is not None and not self.mute:
            self.pty.write(data)
        return bool(data)

    def unplug(self) -> None:
        if self.pty is not None:
            self.pty.close()
        self.pty = None

    def wake(self) -> None:
        pass

    def close(self) -> None:
        self.closed = True

    def applied(self, applied: AppliedOutput) -> None:
        self.told.append(applied)

    def refused(self, refusal: Refusal, _stamp: Stamp) -> None:
        raise AssertionError(refusal.text)

    def found(self, _identity: str) -> None:
        pass

    def troubled(self, text: str) -> None:
        self.troubles.append(text)

    def deliver(self, outputs: Iterable[Output]) -> None:
        self.said += outputs

    def on_idle(self) -> None:
        pass

    def phase(self) -> ArmingPhase:
        return self.told[-1].phase

    def wire(self) -> tuple[float | None, ...]:
        return self.board.pulses_us()[:8]

    def run(self, seconds: float) -> None:
        end = after(self.time, seconds)
        while self.time < end:
            self.sequence += 1
            self.host.command(Command(MOVING, (), self.time, self.sequence))
            slot = after(self.time, 0.02)
            while self.time < slot:
                self.sleep_until(min(max(self.host.turn(), after(self.time, STEP_S)), slot))

    def arm(self) -> None:
        assert self.host.arm(Request(self.time, self.sequence + 1)).accepted


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    made = Bench(tmp_path)
    yield made
    made.host.end()
    made.unplug()


def test_a_flight_from_boot_to_the_end(bench: Bench) -> None:
    bench.run(0.5)
    assert bench.phase() is ArmingPhase.DISARMED
    bench.arm()
    bench.run(7.5)
    assert bench.phase() is ArmingPhase.ARMED
    assert bench.wire() == MOVING
    assert bench.told[-1].pulses_us == MOVING
    bench.host.disarm(Request(bench.time, 10_000))
    bench.run(0.5)
    assert bench.wire() == NEUTRAL
    assert not bench.board.armed


def test_a_board_that_refuses_to_arm_disarms_the_guard_with_its_reason(bench: Bench) -> None:
    bench.run(0.5)
    bench.arm()
    bench.run(6.0)
    bench.board.power_cycle(to_s(bench.time))
    bench.run(2.0)
    assert bench.phase() is ArmingPhase.DISARMED
    assert "neutral for" in bench.told[-1].reason
    assert bench.wire() == NEUTRAL


def test_a_board_that_resets_in_flight_disarms_the_guard(bench: Bench) -> None:
    bench.run(0.5)
    bench.arm()
    bench.run(7.5)
    bench.board.power_cycle(to_s(bench.time))
    bench.run(1.5)
    assert (bench.phase(), bench.told[-1].reason) == (ArmingPhase.DISARMED, "the board has disarmed itself")
    assert bench.wire() == NEUTRAL


def test_a_port_that_goes_away_is_faulted_and_found_again(bench: Bench, tmp_path: Path) -> None:
    bench.run(0.5)
    bench.unplug()
    bench.host.turn()
    assert bench.phase() is ArmingPhase.FAULTED
    assert ": lost (" in bench.troubles[0]
    bench.run(1.0)
    assert bench.phase() is ArmingPhase.FAULTED
    assert any("no such port" in text for text in bench.troubles)
    bench.pty = Pty(tmp_path / "stm32")
    bench.run(3.0)
    assert bench.phase() is ArmingPhase.DISARMED


def test_the_end_gives_port_and_clock_back(bench: Bench, tmp_path: Path) -> None:
    port = (tmp_path / "stm32").resolve()

    def held() -> int:
        return sum(one.resolve() == port for one in Path("/proc/self/fd").iterdir())

    before = held()
    bench.run(0.1)
    assert held() == before + 1
    bench.host.end()
    assert (held(), bench.closed) == (before, True)


def test_a_port_without_a_board_says_so(bench: Bench) -> None:
    bench.board.disguise(True)
    bench.run(4.0)
    assert bench.phase() is ArmingPhase.FAULTED
    assert "no MAVLink heartbeat within 3 s" in bench.told[-1].reason


def test_a_board_that_falls_silent_in_flight_is_faulted_and_nobody_stays_armed(bench: Bench) -> None:
    bench.run(0.5)
    bench.arm()
    bench.run(7.5)
    assert bench.phase() is ArmingPhase.ARMED
    bench.mute = True
    bench.run(4.0)
    assert any(one.phase is ArmingPhase.FAULTED and "fallen silent" in one.reason for one in bench.told)
    assert bench.phase() is ArmingPhase.FAULTED
    bench.mute = False
    bench.run(4.0)
    assert bench.phase() is ArmingPhase.DISARMED


def test_battery_is_delivered(bench: Bench) -> None:
    bench.board.set_truth(SupplyTruth(15.2), 0.0)
    bench.run(1.5)
    found = [one.reading for one in bench.said if isinstance(one, Stamped) and isinstance(one.reading, Battery)]
    assert found[0].voltage_V == pytest.approx(15.2)


def test_what_goes_over_the_line_is_kept_in_both_directions_with_its_time(bench: Bench) -> None:
    bench.run(2.0)
    stamps = [stamp for stamp, _, _ in bench.frames]
    assert stamps == sorted(stamps)
    assert stamps[-1] > after(stamps[0], 1.9)
    for direction, least in ((True, 50), (False, 20)):
        frames = [data for _, sent, data in bench.frames if sent is direction]
        assert len(frames) >= least
        assert frames[0][0] in (0xFD, 0xFE), "MAVLink begins every frame with one of these"
