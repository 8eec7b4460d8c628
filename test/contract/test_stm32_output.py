"""The STM32 as an output behind the guard, over a pty, with the firmware at its far end."""

from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import pytest

from hindrax_core.driver_interface import Output, Send
from hindrax_core.events import Stamp, Stamped, after, stamp_from_s, to_s
from hindrax_core.readings import Battery
from hindrax_core.signals import AppliedOutput, Command
from hindrax_drivers.buses.clock import Meanwhile, nothing
from hindrax_drivers.devices.stm32 import Stm32
from hindrax_drivers.output.output_guard import (
    ArmingPhase,
    OutputGuard,
    OutputGuardKnobs,
    Pulses,
    RefusedCommand,
    Request,
)
from hindrax_drivers.output.output_host import OutputHost
from hindrax_drivers.output.output_ports import LineOutput
from hindrax_sim.buses.serial_ends import Pty
from hindrax_sim.devices.stm32 import Stm32 as Emulator

CHANNELS = (*range(8), 8, 9)
NEUTRAL, ORDERED, MOVING = (1500.0,) * 8, (1600.6,) * 8, (1601.0,) * 8
"""The board makes whole microseconds."""
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
        self.output = LineOutput(str(folder / "stm32"), Stm32(CHANNELS), self, self.tap)
        self.host = OutputHost(self.output, OutputGuard((1500.0,) * 8, 2, OutputGuardKnobs(arming_s=7.1)), self)
        self.sequence, self.mute, self.closed, self.woken = 0, False, False, 0

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
        received = b"" if self.pty is None else self.pty.read()
        data = self.board.receive(received, now_s) + self.board.step(now_s)
        if self.pty is not None and not self.mute:
            self.pty.write(data)
        return bool(data)

    def unplug(self) -> None:
        if self.pty is not None:
            self.pty.close()
        self.pty = None

    def wake(self) -> None:
        self.woken += 1

    def close(self) -> None:
        self.closed = True

    def applied(self, applied: AppliedOutput) -> None:
        self.told.append(applied)

    def refused(self, refusal: RefusedCommand, _stamp: Stamp) -> None:
        raise AssertionError(refusal.text)

    def found(self, _identity: str) -> None:
        pass

    def troubled(self, text: str) -> None:
        self.troubles.append(text)

    def deliver(self, outputs: Iterable[Output]) -> None:
        self.said += outputs

    def on_idle(self) -> None:
        pass

    def phase(self) -> str:
        return self.told[-1].phase

    def wire(self) -> tuple[float | None, ...]:
        return self.board.pulses_us()[:8]

    def run(self, seconds: float) -> None:
        end = after(self.time, seconds)
        while self.time < end:
            self.sequence += 1
            self.host.command(Command(ORDERED, (), self.time, self.sequence))
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


def test_the_end_disarms_the_board(bench: Bench) -> None:
    bench.run(0.5)
    bench.arm()
    bench.run(7.5)
    assert bench.board.armed
    received = len(bench.frames)
    bench.host.end()
    bench.sleep_until(after(bench.time, 0.1))
    assert any(sent for _, sent, _ in bench.frames[received:])
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


def test_a_port_without_a_board_reports_it(bench: Bench) -> None:
    bench.board.disguise(True)
    bench.run(4.0)
    assert bench.phase() is ArmingPhase.FAULTED
    assert "no MAVLink heartbeat; check the board (waited 2 s)" in bench.told[-1].reason


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
    bench.board.set_truth(Battery(15.2), 0.0)
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
    _, sent, first = bench.frames[0]
    assert (sent, first[7:10]) == (True, b"\0\0\0"), "we speak first, by a heartbeat: message 0"


def test_it_sleeps_on_its_clock_no_longer_than_overrides_may_stay_away(bench: Bench) -> None:
    done: list[str] = []
    for seconds, slept_s in ((10.0, 0.02), (0.01, 0.01)):
        begin = bench.time
        bench.output.wait(after(begin, seconds), lambda: done.append("meanwhile"))
        assert bench.time == after(begin, slept_s)
    assert len(done) == 2
    assert list(bench.output.serve()) == [], "no port is open yet"
    bench.output.wake()
    assert bench.woken == 1


class Board(Stm32):
    """The driver with a state of its own; it keeps what it is asked for."""

    asking = False

    def __init__(self, *, armed: bool = False, asking: bool = False, refusal: str = "") -> None:
        super().__init__((0, 1, 8))
        self.armed, self.asking, self.refusal = armed, asking, refusal
        self.asked: list[object] = []

    def override(self, pulses_us: Sequence[float], _stamp: Stamp) -> Send:
        return self._note(pulses_us)

    def arm(self, _stamp: Stamp) -> Send:
        return self._note("arm")

    def disarm(self, _stamp: Stamp) -> Send:
        return self._note("disarm")

    def _note(self, what: object) -> Send:
        self.asked.append(what)
        return Send(b"")


WANTED = Pulses((1600.0, 1400.0), (1100.0,))
HELD = (1500.0, 1500.0, 1100.0)


def written(board: Board, bench: Bench, *wishes: bool) -> LineOutput:
    """The output of a board that the guard wishes to be armed, or not, one write after the other."""
    output = LineOutput("", board, bench, bench.tap)
    for armed in wishes:
        output.write(WANTED, armed=armed)
    return output


def asked_of(board: Board, bench: Bench, *wishes: bool) -> list[object]:
    written(board, bench, *wishes)
    return board.asked


def test_it_is_asked_once_to_arm_and_thrusters_wait_for_it_at_neutral(bench: Bench) -> None:
    assert asked_of(Board(), bench, True, True) == [HELD, "arm", HELD]
    assert asked_of(Board(armed=True), bench, True) == [WANTED.all_us, "arm"]


def test_it_is_asked_to_disarm_until_it_is_disarmed(bench: Bench) -> None:
    assert asked_of(Board(), bench, False, False) == [WANTED.all_us] * 2
    assert asked_of(Board(armed=True), bench, False, False) == [WANTED.all_us, "disarm"] * 2
    assert asked_of(Board(), bench, True, False, False, True) == [
        *(HELD, "arm"), *(WANTED.all_us, "disarm"), WANTED.all_us, *(HELD, "arm")
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("board", "wish", "fault"),
    [
        (Board(), False, ""),
        (Board(refusal="hot"), False, ""),
        (Board(armed=True), True, ""),
        (Board(asking=True), True, ""),
        (Board(), True, "the board has disarmed itself"),
        (Board(refusal="hot"), True, "hot"),
    ],
)
def test_it_complains_of_a_board_that_is_not_armed_although_it_was_asked_to(
    bench: Bench, board: Board, wish: bool, fault: str
) -> None:
    assert written(board, bench, wish).fault() == fault
