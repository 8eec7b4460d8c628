"""The dead man without processes and clocks: crash after crash, a child that hangs, one that is well, an end."""

import contextlib
import json
import os
import signal
import struct
import subprocess
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from hindrax_core.bus_operations import DeviceError, Write, WriteRead
from hindrax_core.events import Stamp, after, stamp_from_s
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.nodes import deadman
from hindrax_drivers.nodes.deadman import (
    BACK_OFF_S,
    HUNG_S,
    REPEAT_S,
    SHUTDOWN_S,
    SILENT_S,
    WELL_AFTER_S,
    DeadMan,
    NeutralWriter,
    WatchedProcess,
)
from hindrax_drivers.nodes.thruster_settings import ENDED, KEEPALIVE_S, LEFT_ARMED, Settings, read_settings
from hindrax_drivers.nodes.thrusters import ARGUMENTS, NEUTRAL_WORD, NODE_WORD
from hindrax_drivers.output.output_guard import OutputGuardKnobs
from hindrax_drivers.output.output_thread import BEAT_S
from hindrax_ros.heartbeat import VARIABLE
from hindrax_ros.standstill import STOOD_STILL

NOW = stamp_from_s(100.0)


def test_the_wire_is_neutral_soon_after_a_silence_and_seen_to_be_repeated() -> None:
    assert 2.0 * BEAT_S < SILENT_S < OutputGuardKnobs().silence_s
    assert REPEAT_S < 0.1  # ten times a second, as the guard repeats
    assert SILENT_S < HUNG_S < SHUTDOWN_S


class Neutral:
    """Counts what would be put on the wire."""

    def __init__(self, _settings: object) -> None:
        self.writes, self.trouble, self.waits, self.woken, self.closed = 0, "", 0, 0, False
        self.armed = self.blocked = self.left_armed = False
        self.clock = self

    def now(self) -> Stamp:
        return NOW

    def write(self) -> None:
        self.writes += 1

    def sleep_until(self, _until: Stamp, _readable: int | None = None) -> None:
        self.waits += 1
        assert self.waits < 100, "nothing ends"

    def wake(self) -> None:
        self.woken += 1

    def release(self) -> None:
        pass

    def close(self) -> None:
        self.closed = True


class Child(WatchedProcess):
    """A child that ends with a code, at once or when it is killed."""

    def __init__(self, code: int, lived_s: float = 0.0, *, ends: bool = True) -> None:
        super().__init__(self, 0, 0, started_s=time.monotonic() - lived_s)  # type: ignore[arg-type]  # its own process
        self.code, self.ends = code, ends
        self.killed = self.asked = self.keepalives = 0
        self.turns_left = 5

    def kill(self) -> None:
        self.killed, self.ends = self.killed + 1, True

    def send_signal(self, _number: int) -> None:
        self.asked += 1

    def listen(self, now: Stamp) -> bool:
        """Until it ends, which takes a child that is asked to some turns."""
        del now
        self.turns_left -= self.asked > 0
        return not self.ends and self.turns_left > 0

    def send_keepalive(self, now_s: float) -> None:
        self.keepalives += now_s > 0.0

    def reap(self) -> int:
        return self.code


@pytest.fixture
def man(monkeypatch: pytest.MonkeyPatch) -> Iterator[DeadMan]:
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    monkeypatch.setattr(deadman, "NeutralWriter", Neutral)
    settings: Any = None
    yield DeadMan(settings, [])
    for number, handler in before.items():
        signal.signal(number, handler)


ENDS: list[str] = []
"""What each child of `run` was told of the end of the one before."""


def run(man: DeadMan, monkeypatch: pytest.MonkeyPatch, *children: Child) -> tuple[int, list[float]]:
    """Exit code, and how long it waited before each next child."""
    waits: list[float] = []
    left = iter(children)

    def wait(_self: DeadMan, seconds: float) -> bool:
        waits.append(seconds)
        return True

    def start(_arguments: object, ended: str, **_left_armed: bool) -> Child:
        ENDS.append(ended)
        return next(left)

    ENDS.clear()
    monkeypatch.setattr(WatchedProcess, "start", start)
    monkeypatch.setattr(DeadMan, "_wait", wait)
    return man.run(), waits


def test_however_often_the_node_crashes_it_is_started_again_ever_later(
    man: DeadMan, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code, waits = run(man, monkeypatch, *[Child(1) for _ in range(8)], Child(0))
    first = "thrusters: the node ended with 1; neutral is on the wire, it restarts in 0.5 s"
    assert capsys.readouterr().err.splitlines()[0] == first
    assert (code, waits) == (0, [*BACK_OFF_S[1:], *[BACK_OFF_S[-1]] * 4])
    assert ["", *["the node ended with 1"] * 8] == ENDS


def test_a_node_that_stood_still_is_started_at_once_however_often(
    man: DeadMan, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    _, waits = run(man, monkeypatch, Child(STOOD_STILL), Child(STOOD_STILL), Child(0))
    assert waits == [0.0, 0.0]
    said = "thrusters: the node had stood still; neutral is on the wire, it restarts in 0 s"
    assert capsys.readouterr().err.splitlines() == [said] * 2
    assert ["", *["the node had stood still"] * 2] == ENDS


def test_a_node_that_was_well_for_long_is_started_at_once(man: DeadMan, monkeypatch: pytest.MonkeyPatch) -> None:
    _, waits = run(man, monkeypatch, Child(1), Child(1), Child(1, lived_s=WELL_AFTER_S + 1.0), Child(1), Child(0))
    assert waits == [BACK_OFF_S[1], BACK_OFF_S[2], 0.0, BACK_OFF_S[1]]


def test_a_child_that_hangs_is_killed(man: DeadMan, monkeypatch: pytest.MonkeyPatch) -> None:
    child = Child(-9, ends=False)
    child.beaten_at, child.beaten_s = Stamp(NOW - stamp_from_s(HUNG_S + 0.1)), time.monotonic() - HUNG_S - 0.1
    run(man, monkeypatch, child, Child(0))
    assert child.killed == 1


@pytest.mark.parametrize(("ago_s", "beaten_s"), [(HUNG_S + 1.0, 0.0), (HUNG_S - 1.0, HUNG_S + 1.0)])
def test_one_clock_alone_does_not_show_that_a_child_hangs(ago_s: float, beaten_s: float) -> None:
    child = Child(0)
    child.beaten_at, child.beaten_s = Stamp(NOW - stamp_from_s(ago_s)), time.monotonic() - beaten_s
    assert not child.hung(NOW)


def test_a_child_that_never_beat_is_starting_and_has_not_hung() -> None:
    child = Child(0)
    child.beaten_s = time.monotonic() - 10.0 * HUNG_S
    assert not child.hung(NOW)
    assert child.silent_from(NOW) == NOW


def test_silence_begins_a_moment_after_the_last_beat_and_at_once_when_the_clock_went_back() -> None:
    child = Child(0)
    child.beaten_at = NOW
    assert child.silent_from(NOW) == NOW + stamp_from_s(SILENT_S)
    child.beaten_at = Stamp(NOW + 1)
    assert child.silent_from(NOW) == NOW


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_is_an_order_to_end(man: DeadMan, number: signal.Signals) -> None:
    assert man._asked_s is None
    signal.raise_signal(number)
    assert man._asked_s is not None


def test_an_order_to_end_goes_to_the_child_once_and_neutral_is_last(
    man: DeadMan, monkeypatch: pytest.MonkeyPatch
) -> None:
    child = Child(-15, ends=False)
    man._ask(signal.SIGTERM, None)
    code, waits = run(man, monkeypatch, child)
    assert (code, waits, child.asked, child.killed) == (0, [], 1, 0)
    neutral: Any = man._neutral
    assert neutral.writes >= 3
    assert neutral.closed
    neutral.trouble = "no bus"
    assert run(man, monkeypatch, Child(-15, ends=False))[0] == 1, "neutral is not on the wire"
    neutral.trouble, neutral.left_armed = "", True
    assert run(man, monkeypatch, Child(-15, ends=False))[0] == 1, "an autopilot may be armed still"


class Stops:
    """Somebody asks to stop, until he is answered."""

    def __init__(self) -> None:
        self.pending = True
        self.answers: list[tuple[str, bool]] = []

    def answer(self, how: str, *, neutral: bool) -> None:
        self.pending = False
        self.answers.append((how, neutral))


def test_a_node_that_starts_obeys_a_stop_without_being_asked(man: DeadMan) -> None:
    child, stops = Child(0), Stops()
    man._stops = stops  # type: ignore[assignment]  # its own request
    assert man._obeys(child, 100.0)
    assert stops.answers == [("the node was starting, disarmed", True)]
    assert man._neutral.writes == 1  # type: ignore[attr-defined]  # our own


def test_a_node_that_has_disarmed_answers_a_stop_with_neutral(man: DeadMan) -> None:
    child, stops = Child(0), Stops()
    man._stops = stops  # type: ignore[assignment]  # its own request
    child.beaten_at, child.stop_s, child.disarmed = NOW, 10.0, True
    assert man._obeys(child, 12.0)
    assert stops.answers == [("disarmed", True)]
    assert child.stop_s is None


@pytest.mark.parametrize(("waited_s", "obeys"), [(0.9, True), (1.1, False), (10.5, False)])
def test_a_node_that_does_not_disarm_in_a_second_does_not_obey(man: DeadMan, waited_s: float, obeys: bool) -> None:
    child = Child(0, ends=False)
    man._stops = Stops()  # type: ignore[assignment]  # its own request
    child.beaten_at, child.stop_s, child.armed = NOW, 10.0, True
    assert man._obeys(child, 10.0 + waited_s) is obeys


def test_an_autopilot_is_disarmed_again_and_again_until_it_says_so(
    man: DeadMan, monkeypatch: pytest.MonkeyPatch
) -> None:
    neutral: Any = man._neutral
    neutral.armed, released = True, []

    def write() -> None:
        neutral.writes += 1
        neutral.armed = neutral.writes < 3

    monkeypatch.setattr(neutral, "write", write)
    monkeypatch.setattr(neutral, "release", lambda: released.append(neutral.writes))
    man._see_disarmed()
    assert (neutral.writes, released) == (3, [3])


class Chip:
    """Registers of a PCA9685 on a bus of its own, whose time goes on when somebody sleeps."""

    def __init__(self) -> None:
        self.registers, self.trouble = bytearray(256), ""
        self.time, self.woken, self.closed = NOW, 0, 0
        self.sleeps: list[tuple[Stamp, int | None]] = []

    def now(self) -> Stamp:
        return self.time

    def sleep_until(self, until: Stamp, readable: int | None = None) -> None:
        self.sleeps.append((until, readable))
        self.time = max(self.time, until)

    def wake(self) -> None:
        self.woken += 1

    def close(self) -> None:
        self.closed += 1

    def transfer(self, transaction: Write | WriteRead) -> bytes:
        if self.trouble:
            raise DeviceError(self.trouble)
        at = transaction.data[0]
        if isinstance(transaction, WriteRead):
            return bytes(self.registers[at : at + transaction.count])
        self.registers[at : at + len(transaction.data) - 1] = transaction.data[1:]
        return b""


VEHICLE_FILE = Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml"
VEHICLE = load_vehicle(VEHICLE_FILE)
LED0_OFF, COUNTS_AT_REST = 8, round(1500.0 * 25.0 / 31.0)
"""End of the first channel's pulse: register and value, for PRE_SCALE 30 of a 25 MHz clock (rev. 4, section 7.3.5)."""


@pytest.fixture
def chip(monkeypatch: pytest.MonkeyPatch) -> Chip:
    made = Chip()

    def opened(port: str, client: str) -> Chip:
        assert (port, client) == ("/dev/i2c-1", "thrusters dead man")
        if made.trouble:
            raise DeviceError(made.trouble)
        return made

    monkeypatch.setattr(deadman, "open_bus", opened)
    return made


def rest(chip: Chip) -> int:
    """End of the first channel's pulse [counts]."""
    return int.from_bytes(chip.registers[LED0_OFF : LED0_OFF + 2], "little") - int.from_bytes(
        chip.registers[LED0_OFF - 2 : LED0_OFF], "little"
    )


def test_the_rest_of_the_dead_man_is_that_of_the_guard(chip: Chip) -> None:
    words = [
        f"vehicle:={VEHICLE_FILE}",
        "neutral_us:=1520.0",
        "light_off_us:=1000",
    ]
    NeutralWriter(read_settings([word for one in words for word in ("-p", one)])).write()
    counts = struct.unpack_from("<20H", chip.registers, 6)
    assert counts[::2] == (0,) * 10, "pulses begin at count 0"
    steps = [round(us * 25.0 / 31.0) for us in (1520.0, 1000.0)]  # rev. 4, section 7.3.5: (PRE_SCALE + 1) / 25 MHz
    assert counts[1::2] == (steps[0],) * 8 + (steps[1],) * 2


def test_neutral_is_written_and_a_chip_that_lost_its_supply_is_set_up(chip: Chip) -> None:
    neutral = NeutralWriter(Settings(VEHICLE, "/dev/i2c-1"))
    neutral.write()
    assert neutral.trouble == ""
    assert abs(rest(chip) - COUNTS_AT_REST) <= 1
    assert chip.registers[0xFE] == 30, "PRE_SCALE"
    assert chip.time > NOW, "the oscillator was waited for"
    slept = len(chip.sleeps)
    chip.registers[LED0_OFF] ^= 0xFF
    neutral.write()
    assert abs(rest(chip) - COUNTS_AT_REST) <= 1
    assert len(chip.sleeps) == slept, "a chip that is set up is not set up again"


def test_what_cannot_be_written_is_reported_once_and_tried_again(
    chip: Chip, capsys: pytest.CaptureFixture[str]
) -> None:
    neutral = NeutralWriter(Settings(VEHICLE, "/dev/i2c-1"))
    for trouble in ("no acknowledge", "no acknowledge", "a line is low"):
        chip.trouble = trouble
        neutral.write()
        assert neutral.trouble == trouble
        assert not neutral.blocked, "a bus is nobody's"
    sent = [f"thrusters: cannot write neutral: {why}" for why in ("no acknowledge", "a line is low")]
    assert capsys.readouterr().err.splitlines() == sent
    chip.trouble = ""
    neutral.write()
    assert neutral.trouble == ""
    assert abs(rest(chip) - COUNTS_AT_REST) <= 1


def test_it_sleeps_by_the_clock_of_the_bus_as_soon_as_there_is_one(chip: Chip) -> None:
    neutral, (readable, other) = NeutralWriter(Settings(VEHICLE, "/dev/i2c-1")), os.pipe()
    assert abs(neutral.clock.now() - time.time_ns()) < stamp_from_s(60.0)
    until = after(neutral.clock.now(), 60.0)
    neutral.clock.wake()
    neutral.clock.sleep_until(until, readable)
    os.write(other, b"!")
    neutral.clock.sleep_until(until, readable)
    assert neutral.clock.now() < until, "neither an order to end nor a beat waits for the time"
    assert (chip.woken, chip.sleeps) == (0, [])
    neutral.write()
    assert neutral.clock.now() == chip.time
    neutral.clock.sleep_until(Stamp(chip.time + 5), readable)
    assert chip.sleeps[-1] == (chip.time, readable)
    neutral.clock.wake()
    neutral.close()
    assert (chip.woken, chip.closed) == (1, 1)
    os.close(readable)
    os.close(other)


def test_both_descriptors_of_the_clock_are_given_back(chip: Chip) -> None:
    open_files = len(list(Path("/proc/self/fd").iterdir()))
    assert deadman.write_neutral(Settings(VEHICLE, "/dev/i2c-1")) == 0
    assert len(list(Path("/proc/self/fd").iterdir())) == open_files
    assert chip.closed == 1


@pytest.mark.parametrize(
    ("device", "more"), [("stm32", ""), ("ardusub", ", and may still be armed: disarm it at a ground station")]
)
def test_an_output_with_a_mind_of_its_own_goes_neutral_by_itself(
    device: str, more: str, chip: Chip, capsys: pytest.CaptureFixture[str]
) -> None:
    board = replace(VEHICLE, output=replace(VEHICLE.output, device=device))
    assert deadman.write_neutral(Settings(board, "/dev/ttyS0")) == 0
    assert capsys.readouterr().out == f"the {device} goes neutral by itself without commands{more}\n"
    assert rest(chip) == 0


def test_neutral_of_forces_on_a_topic_is_zero_by_who_stands_by(monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[str] = []

    class StandsBy:
        def __init__(self, arguments: object) -> None:
            sent.append(f"for {arguments}")

        def send(self) -> None:
            sent.append("zeros")

        def close(self) -> str:
            return "nobody has taken them"

    monkeypatch.setattr(deadman, "ZeroForces", StandsBy)
    board = replace(VEHICLE, output=replace(VEHICLE.output, device="ros2_control"))
    writer = deadman.NeutralWriter(Settings(board, "/{name}/reference", arguments=("--some",)))
    writer.write()
    assert (sent, writer.left_armed) == (["for ('--some',)", "zeros"], False)
    writer.close()
    assert writer.trouble == "nobody has taken them"


def test_the_last_resort_writes_neutral_once_and_states_whether_it_is_there(
    chip: Chip, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(ARGUMENTS, json.dumps([NEUTRAL_WORD, "--ros-args"]))
    monkeypatch.setattr(deadman, "read_settings", lambda _words: Settings(VEHICLE, "/dev/i2c-1"))
    assert deadman.main() == 0
    assert (capsys.readouterr().out, chip.closed) == ("neutral is on the wire\n", 1)
    chip.trouble = "a line is low"
    assert deadman.main() == 1
    assert capsys.readouterr().out == ""


def test_without_a_vehicle_it_is_wrong_use_in_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(ARGUMENTS, "[]")
    assert deadman.main() == 2
    assert capsys.readouterr().err.startswith("thrusters: thrusters: no vehicle file")


def test_two_thrusters_on_one_channel_are_wrong_use_before_anything_is_written(
    chip: Chip, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(ARGUMENTS, json.dumps(["-p", "channels:=[2, 2]", "-p", "port:=/dev/i2c-1"]))
    assert deadman.main() == 2
    assert "output channel 2 drives T1 and T2" in capsys.readouterr().err
    assert rest(chip) == 0


class Pipes:
    """A watched process that is no process: the test holds the other ends of its pipes."""

    def __init__(self) -> None:
        (self.beats, self.beat), (self.life_end, self.life) = os.pipe(), os.pipe()
        for end in (self.beats, self.life, self.life_end):
            os.set_blocking(end, False)
        self.child = WatchedProcess(self, self.beats, self.life)  # type: ignore[arg-type]  # its own process

    def wait(self) -> int:
        return 7


def test_beats_are_received_and_a_closed_pipe_is_a_dead_child() -> None:
    pipes = Pipes()
    child, before = pipes.child, pipes.child.beaten_s
    assert child.listen(NOW)
    assert (child.beaten_at, child.beaten_s) == (None, before)
    os.write(pipes.beat, b"..")
    assert child.listen(NOW)
    assert child.beaten_at == NOW
    assert child.beaten_s > before
    os.close(pipes.beat)
    assert not child.listen(Stamp(NOW + 1))
    assert child.beaten_at == NOW
    assert child.reap() == 7
    for end in (pipes.beats, pipes.life):
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.fstat(end)
    os.close(pipes.life_end)


def test_the_child_gets_a_keepalive_now_and_then() -> None:
    pipes = Pipes()
    for now_s, sent in ((100.0, b"!"), (100.0 + 0.9 * KEEPALIVE_S, b""), (100.0 + KEEPALIVE_S, b"!")):
        pipes.child.send_keepalive(now_s)
        with contextlib.suppress(BlockingIOError):
            found = b""
            found = os.read(pipes.life_end, 10)
        assert found == sent
    os.close(pipes.life_end)
    pipes.child.send_keepalive(200.0)  # it has died: `listen` tells
    pipes.child.reap()
    os.close(pipes.beat)


def test_a_child_starts_in_a_session_of_its_own_with_both_pipes_and_another_heartbeat(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    started: dict[str, Any] = {}

    def popen(words: list[str], **options: Any) -> Any:
        started.update(options, words=words)
        beat, life_end = options["pass_fds"]
        os.write(beat, b".")
        started["life"] = os.dup(life_end)

    monkeypatch.setattr(subprocess, "Popen", popen)
    monkeypatch.setenv(VARIABLE, "/run/beat")
    child = WatchedProcess.start(["--more"], "the node ended with -9", left_armed=True)
    beat, life_end = started["pass_fds"]
    assert started["words"][1:] == [
        "-m",
        "hindrax_drivers.nodes.thrusters",
        NODE_WORD,
        str(beat),
        str(life_end),
        "--more",
    ]
    assert started["start_new_session"]
    assert started["env"][VARIABLE] == "/run/beat_node"
    assert started["env"][ENDED] == "the node ended with -9"
    assert LEFT_ARMED in started["env"]
    assert not os.get_blocking(child.beats)
    assert not os.get_blocking(child.life)
    assert child.listen(NOW)
    assert child.beaten_at == NOW
    assert not child.listen(NOW), "only the child holds the other end"
    for end in (beat, life_end):
        with pytest.raises(OSError, match="Bad file descriptor"):
            os.fstat(end)
    child.send_keepalive(0.5)
    assert os.read(started["life"], 10) == b"!", "at once, even just after the machine has started"
    for end in (child.beats, child.life, started["life"]):
        os.close(end)
    monkeypatch.delenv(VARIABLE)
    assert deadman._of_the_node("") == ""


def test_between_two_nodes_neutral_is_repeated_until_it_is_time_or_asked_to_end(
    man: DeadMan, monkeypatch: pytest.MonkeyPatch
) -> None:
    now_s = iter(range(1000, 2000))
    monkeypatch.setattr(time, "monotonic", lambda: float(next(now_s)))
    neutral: Any = man._neutral
    beats: list[float] = []
    monkeypatch.setattr(man, "_heartbeat", SimpleNamespace(beat=beats.append))
    open_files = len(list(Path("/proc/self/fd").iterdir()))
    assert man._wait(20.0)
    assert len(list(Path("/proc/self/fd").iterdir())) == open_files
    assert len(beats) == neutral.writes
    assert 5 <= neutral.writes <= 20
    assert neutral.waits == neutral.writes
    man._ask(signal.SIGTERM, None)
    first = man._asked_s
    man._ask(signal.SIGTERM, None)
    assert man._asked_s == first, "the time to end counts from the first order"
    assert neutral.woken == 2
    before = neutral.writes
    assert not man._wait(20.0)
    assert neutral.writes == before


def test_what_a_dying_child_may_still_have_written_is_neutral_again_before_the_next_one_starts(
    man: DeadMan, monkeypatch: pytest.MonkeyPatch
) -> None:
    neutral: Any = man._neutral

    class Witness(Child):
        """Knows how often neutral had been written when it began to live and when it was gone."""

        began = gone = -1

        def listen(self, now: Stamp) -> bool:
            self.began = neutral.writes if self.began < 0 else self.began
            return super().listen(now)

        def reap(self) -> int:
            self.gone = neutral.writes
            return super().reap()

    first, second = Witness(1), Witness(0)
    run(man, monkeypatch, first, second)
    assert (first.began, first.gone) == (1, 2), "at the start, and before it waits for the child to be gone"
    assert second.began > first.gone


def test_who_is_asked_to_end_between_two_nodes_ends_with_neutral(man: DeadMan, monkeypatch: pytest.MonkeyPatch) -> None:
    neutral: Any = man._neutral
    before: list[int] = []

    def wait(_seconds: float) -> bool:
        before.append(neutral.writes)
        man._ask(signal.SIGTERM, None)
        return False

    monkeypatch.setattr(WatchedProcess, "start", lambda _arguments, _ended, **_: Child(1))
    monkeypatch.setattr(man, "_wait", wait)
    assert man.run() == 0
    assert neutral.writes > before[0]
    assert neutral.closed


def test_an_order_to_end_after_the_end_is_no_error(man: DeadMan, monkeypatch: pytest.MonkeyPatch) -> None:
    writer = NeutralWriter(Settings(VEHICLE, "/dev/i2c-1"))
    monkeypatch.setattr(man, "_neutral", writer)
    writer.close()
    other = os.eventfd(0, os.EFD_NONBLOCK)  # has the number of the descriptor that was closed
    man._ask(signal.SIGTERM, None)
    with pytest.raises(BlockingIOError):
        os.eventfd_read(other)
    os.close(other)
    assert man._asked_s is not None


def test_its_own_heart_beats_while_it_watches(man: DeadMan, monkeypatch: pytest.MonkeyPatch) -> None:
    beats: list[float] = []
    monkeypatch.setattr(man, "_heartbeat", SimpleNamespace(beat=beats.append))
    child = Child(0, ends=False)
    child.asked, child.turns_left = 1, 4
    man._watch(child)
    assert len(beats) == 3


def test_a_child_that_does_not_end_when_it_is_asked_to_is_killed(man: DeadMan, monkeypatch: pytest.MonkeyPatch) -> None:
    child = Child(-9, ends=False)
    child.turns_left = 50
    man._asked_s = time.monotonic() - SHUTDOWN_S - 1.0
    run(man, monkeypatch, child)
    assert child.killed == 1


def test_a_silent_child_has_neutral_written_in_its_place_and_a_beating_one_has_not(
    man: DeadMan, monkeypatch: pytest.MonkeyPatch
) -> None:
    waited: list[float] = []
    neutral: Any = man._neutral
    monkeypatch.setattr(neutral, "sleep_until", lambda until, _readable: waited.append((until - NOW) / 1e9))
    child = Child(0, ends=False)
    child.asked, child.turns_left = 1, 4
    child.beaten_at = NOW
    man._watch(child)
    assert neutral.writes == 1, "only at its end"
    assert waited == [SILENT_S] * 3
    assert child.keepalives == 3, "it knows in every turn that somebody watches"
    silent = Child(0, ends=False)
    silent.asked, silent.turns_left = 1, 4
    man._watch(silent)
    assert neutral.writes == 1 + 3 + 1
    assert waited[3:] == [pytest.approx(REPEAT_S)] * 3


def test_wrong_use_of_the_node_ends_the_dead_man_with_its_code(man: DeadMan, monkeypatch: pytest.MonkeyPatch) -> None:
    assert run(man, monkeypatch, Child(2)) == (2, [])
