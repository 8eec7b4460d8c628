"""The node of the thrusters without its thread: what it passes on, what it refuses, what it says of the output."""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

pytest.importorskip("rclpy", reason="needs the ROS environment")
pytest.importorskip("hindrax_msgs.msg", reason="needs the built workspace")

import rclpy
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Float32MultiArray

from hindrax_core.driver_interface import Identity
from hindrax_core.events import Rejected, Stamp, Stamped
from hindrax_core.readings import AppliedPulses, Battery
from hindrax_core.signals import AppliedOutput, Command
from hindrax_core.text.refusals import Reason, Refusal
from hindrax_core.vehicle import Mount, Vehicle, load_vehicle
from hindrax_drivers.lifecycle import ON_REQUEST, State
from hindrax_drivers.nodes import thrusters_node
from hindrax_drivers.nodes.thruster_settings import ENDED, Settings, read_settings
from hindrax_drivers.nodes.thrusters_node import LOOK_S, ThrustersNode, watch_parent
from hindrax_drivers.output.output_guard import (
    Answer,
    ArmingPhase,
    CommandFault,
    OutputGuard,
    OutputGuardKnobs,
    Pulses,
    RefusedCommand,
    Request,
)
from hindrax_drivers.output.output_reasons import OutputReason, output_reason
from hindrax_msgs.msg import ThrusterCommand, ThrusterState
from hindrax_msgs.srv import Arm
from hindrax_ros.messages.serialization import deserialized

FILE = Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml"
VEHICLE = load_vehicle(FILE)
BOARD = replace(VEHICLE, output=replace(VEHICLE.output, device="stm32"), sensors={})
ONE, OTHER = "/hindrax/allocator", "/somebody/allocator"
DEAD_MAN = "the dead man does not answer"


class Thread:
    """In the place of the output's thread: keeps what it is told."""

    def __init__(
        self, make: Callable[[], Any], guard: OutputGuard, listener: ThrustersNode, beat: Callable[[], None]
    ) -> None:
        self.make, self.guard, self.listener, self.beat = make, guard, listener, beat
        self.ready, self.left_armed, self.now = True, False, Stamp(5)
        self.calls: list[tuple[Any, ...]] = []
        self.answer: Answer | None = Answer(accepted=True)

    def __getattr__(self, name: str) -> Callable[..., Any]:
        return lambda *calls: self.calls.append((name, *calls))

    def arm(self, request: Request) -> Future[Answer]:
        return self._answered("arm", request)

    def disarm(self, request: Request) -> Future[Answer]:
        return self._answered("disarm", request)

    def _answered(self, name: str, request: Request) -> Future[Answer]:
        self.calls.append((name, request))
        future: Future[Answer] = Future()
        if self.answer is not None:
            future.set_result(self.answer)
        return future


class Bench:
    """The node, its thread, its callbacks by topic, what it publishes by topic, its log, and who commands it."""

    def __init__(self, settings: Settings, patch: pytest.MonkeyPatch) -> None:
        self.callbacks: dict[str, Callable[[Any], None]] = {}
        self.published: dict[str, list[Any]] = {}
        self.log: list[str] = []
        self.publishers, self.looks, self.now_s = {"01": ONE}, 0, 0.5
        self.alive, beat = os.pipe()
        patch.setattr(thrusters_node, "OutputThread", Thread)
        patch.setattr(thrusters_node, "subscription", self._subscription)
        patch.setattr(thrusters_node, "publisher", self._publisher)
        patch.setattr(thrusters_node, "publishers_of", self._look)
        patch.setattr(time, "monotonic", lambda: self.now_s)
        self.node = ThrustersNode(settings, beat)
        patch.setattr(self.node, "get_logger", lambda: SimpleNamespace(info=self.log.append, warning=self.log.append))
        self.thread: Any = self.node._thread  # what stands in its place
        self.beat = beat

    def _subscription(self, _node: object, topic: Any, act: Callable[[Any], None], *, raw: bool = False) -> None:
        assert raw == (topic.name == "thrusters/command"), "read as bytes"
        self.callbacks[topic.name] = act

    def _publisher(self, _node: object, topic: Any) -> Any:
        return SimpleNamespace(publish=self.published.setdefault(topic.name, []).append)

    def _look(self, _node: object, topic: Any) -> dict[str, str]:
        assert topic.name == "thrusters/command"
        self.looks += 1
        return self.publishers

    def command(self, sequence: int) -> list[Any]:
        """What the thread is told of a command."""
        before = len(self.thread.calls)
        message = ThrusterCommand(sequence=sequence, pulses=[1500.0, 1600.0], lights=[1100.0])
        message.header.stamp.sec = 3
        self.callbacks["thrusters/command"](bytes(serialize_message(message)))
        return list(self.thread.calls[before:])

    def ask(self, **fields: Any) -> tuple[bool, str]:
        request = Arm.Request(**fields)
        request.stamp.sec = 7
        (service,) = (one for one in self.node.services if one.srv_name == "thrusters/arm")
        answer = service.callback(request, Arm.Response())
        return answer.accepted, answer.reason

    def inhibitions(self) -> list[str]:
        """Reasons, in their order, since the last time."""
        calls = [one[1] for one in self.thread.calls if one[0] == "inhibit"]
        self.thread.calls.clear()
        return calls

    def becomes(self, phase: ArmingPhase, reason: str = "") -> None:
        self.node.applied(
            AppliedOutput(Stamp(6_000_000_007), phase is ArmingPhase.ARMED, (1500.0, 1600.5), 9, 2, phase, reason)
        )


Make = Callable[..., Bench]


@pytest.fixture
def make(ros_domain: int, monkeypatch: pytest.MonkeyPatch) -> Iterator[Make]:
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    made: list[Bench] = []

    def bench(*words: str, vehicle: Vehicle = VEHICLE, settings: Settings | None = None) -> Bench:
        rclpy.init(args=["--ros-args", *words])
        made.append(Bench(settings or Settings(vehicle, "/dev/i2c-1", "mock:clock"), monkeypatch))
        return made[-1]

    yield bench
    for one in made:
        one.node.destroy_node()
        os.close(one.alive)
    rclpy.try_shutdown()


def command_of(sequence: int) -> tuple[str, Command]:
    return ("command", Command((1500.0, 1600.0), (1100.0,), Stamp(3_000_000_000), sequence))


def test_a_command_and_levels_of_lamps_reach_the_guard(make: Make) -> None:
    bench = make()
    assert bench.thread.calls == [("start",)]
    assert bench.command(7) == [command_of(7)]
    bench.callbacks["lights"](Float32MultiArray(data=[0.5, 1.0]))
    assert bench.thread.calls[-1] == ("light", (0.5, 1.0))


@pytest.mark.parametrize(
    "data", [b"", b"\x00\x00" + bytes(60), b"\x00\x01" + bytes(6)], ids=["none", "big endian", "short"]
)
def test_bytes_that_are_no_command_are_refused_and_end_nothing(make: Make, data: bytes) -> None:
    bench = make()
    bench.callbacks["thrusters/command"](data)
    assert bench.thread.calls == [("start",)]
    assert bench.node.health.rejects == {"not a command": 1}


def test_the_output_is_opened_with_the_rest_of_the_guard_whose_knobs_are_parameters(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = make("-p", "neutral_us:=1520.0", "-p", "light_off_us:=1000")
    neutral = Pulses((1520.0,) * 8, (1000.0,) * 2)
    assert bench.thread.guard.neutral == neutral
    opened: list[Any] = []
    monkeypatch.setattr(thrusters_node, "open_output", lambda *words, **more: opened.append((words, more)))
    bench.thread.make()
    words = (VEHICLE, "/dev/i2c-1", "mock:clock", bench.node.tap.add, "thrusters")
    assert opened == [(words, {"neutral": neutral, "riders": [], "left_armed": False})]


def test_a_node_that_was_started_again_says_how_the_one_before_it_ended(
    make: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(ENDED, "the node ended with -9")
    assert make().thread.guard.begun == "not armed since the node ended with -9 and was started again"


def test_parameters_are_fixed_at_start(make: Make) -> None:
    node = make().node
    assert [node.get_parameter(name).value for name in ("port", "clock")] == ["/dev/i2c-1", "mock:clock"]
    assert not node.has_parameter("channels")
    assert node.describe_parameter("neutral_us").read_only


def test_an_output_without_a_vehicle_file_declares_its_channels(make: Make) -> None:
    words = ["-p", "channels:=[2, 5]"]
    bench = make(*words, settings=read_settings(words))
    assert list(bench.node.get_parameter("channels").value) == [2, 5]
    assert bench.thread.guard.rest_us == (1500.0,) * 2


def test_it_is_inhibited_while_there_is_a_reason_and_states_all_of_them(make: Make) -> None:
    bench = make()
    for answers in (True, False, False):
        bench.node.on_dead_man(answers=answers)
    assert bench.inhibitions() == [DEAD_MAN]
    bench.node.on_request(State.INACTIVE)
    bench.node.on_dead_man(answers=True)
    bench.node.on_request(State.ACTIVE)
    why = ON_REQUEST[State.INACTIVE]
    assert bench.inhibitions() == [f"{DEAD_MAN}; {why}", why, ""]


def test_whoever_commands_beside_another_is_not_obeyed_and_disarms(make: Make) -> None:
    bench = make()
    bench.command(1)
    bench.publishers = {"01": ONE, "02": OTHER}
    assert bench.command(2) == [command_of(2)], "the graph was just looked at"
    bench.now_s += LOOK_S
    why = f"thrusters/command: found 2 publishers ({ONE}, {OTHER}), wanted one"
    refused = ("refuse", RefusedCommand(CommandFault.SENDER, why))
    assert bench.command(3) == [("inhibit", why), refused]
    assert bench.command(4) == [refused]
    assert bench.looks == 2
    bench.becomes(ArmingPhase.DISARMED, why)
    assert bench.node.health.alarm == output_reason(OutputReason.UNOBEYED, refused=why), (
        "an error in /diagnostics before anybody arms"
    )
    bench.publishers = {"01": ONE}
    bench.now_s += LOOK_S
    assert bench.command(5) == [("inhibit", ""), command_of(5)]


def test_an_armed_output_obeys_no_other_than_before_but_is_not_disarmed_by_one_who_went(make: Make) -> None:
    bench = make()
    bench.command(1)
    bench.becomes(ArmingPhase.ARMED)
    bench.publishers, bench.now_s = {}, bench.now_s + LOOK_S
    assert [name for name, *_ in bench.command(2)] == ["refuse"]
    assert bench.inhibitions() == []
    bench.publishers, bench.now_s = {"02": OTHER}, bench.now_s + LOOK_S
    bench.command(3)
    found = f"found {OTHER}, wanted {ONE}, as when the thrusters were armed; disarm first"
    assert bench.inhibitions() == [f"thrusters/command: {found}"]
    bench.becomes(ArmingPhase.DISARMED)
    bench.now_s += LOOK_S
    assert bench.command(4) == [("inhibit", ""), command_of(4)]


def test_an_armed_output_that_obeys_no_command_is_an_error_in_diagnostics_and_is_logged_once(make: Make) -> None:
    bench = make()
    bench.becomes(ArmingPhase.ARMED)
    assert bench.node.health.alarm == ""
    for age in ("0.31", "0.35"):
        bench.node.refused(RefusedCommand(CommandFault.EXPIRED, f"command is {age} s old"), Stamp(1))
        unobeyed = output_reason(OutputReason.UNOBEYED, refused=f"command is {age} s old")
        bench.becomes(ArmingPhase.ARMED, unobeyed)
        assert bench.node.health.alarm == f"armed, but neutral: {unobeyed}"
    first = output_reason(OutputReason.UNOBEYED, refused="command is 0.31 s old")
    assert bench.log == ["armed", "command refused: command is 0.31 s old", f"armed: {first}"]
    bench.becomes(ArmingPhase.ARMED)
    assert (bench.node.health.alarm, bench.log[-1]) == ("", "armed")


def test_who_asks_to_arm_is_judged_by_the_graph_of_now_and_answered_as_the_guard_states(make: Make) -> None:
    bench = make()
    bench.command(1)
    assert bench.ask(arm=True, sequence=3) == (True, "")
    assert (bench.looks, bench.thread.calls[-1]) == (2, ("arm", Request(Stamp(7_000_000_000), 3, "")))
    assert bench.ask(arm=False, sequence=4, reason="tether cut") == (True, "")
    assert (bench.looks, bench.thread.calls[-1]) == (2, ("disarm", Request(Stamp(7_000_000_000), 4, "tether cut")))
    bench.thread.answer = Answer(accepted=False, reason=Refusal(Reason.LATE, "late"))
    assert bench.ask(arm=True, sequence=5) == (False, "late")
    assert bench.log == ["arm: accepted", "disarm: tether cut", "arm: late"]


def test_an_output_that_does_not_answer_refuses(make: Make, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(thrusters_node, "ANSWER_S", 0.0)
    bench = make()
    bench.thread.answer = None
    assert bench.ask(arm=True) == (False, "the output does not answer; see /diagnostics")
    assert bench.log == []


def test_what_was_applied_is_published_and_a_change_of_phase_is_reported_once(make: Make) -> None:
    bench = make()
    bench.node.found("PCA9685 at 0x40")
    bench.becomes(ArmingPhase.ARMED)
    bench.becomes(ArmingPhase.ARMED)
    state = deserialize_message(bench.published["thrusters/state"][-1], ThrusterState)
    assert (state.header.stamp.sec, state.header.stamp.nanosec) == (6, 7)
    assert (state.armed, state.state, state.reason, state.output) == (True, "armed", "", "pca9685")
    assert (list(state.pulses), state.sequence, state.armings) == ([1500.0, 1600.5], 9, 2)
    health = bench.node.health
    assert (health.readings, health.last_reading, health.note) == (2, bench.thread.now, "armed")
    bench.becomes(ArmingPhase.DISARMED, "silence")
    assert health.note == "disarmed: silence"
    state = deserialize_message(bench.published["thrusters/state"][-1], ThrusterState)
    assert (state.armed, state.state, state.reason) == (False, "disarmed", "silence")
    assert health.identity == "PCA9685 at 0x40 on /dev/i2c-1"
    bench.becomes(ArmingPhase.FAULTED, "no acknowledge")
    assert (health.identity, health.readings) == ("", 3), "a faulted output measures nothing"
    assert bench.log == [
        "found PCA9685 at 0x40 on /dev/i2c-1",
        "armed",
        "disarmed: silence",
        "faulted: no acknowledge",
    ]


def test_refusals_are_counted_by_reason_and_the_first_of_each_is_reported(make: Make) -> None:
    bench = make()
    for reason in (CommandFault.EXPIRED, CommandFault.EXPIRED, CommandFault.SENDER):
        bench.node.refused(RefusedCommand(reason, f"it is {reason}"), Stamp(1))
    assert bench.node.health.rejects == {"expired": 2, "sender": 1}
    assert bench.log == ["command refused: it is expired", "command refused: it is sender"]


BOARD_OUTPUTS = (
    Stamped(Stamp(2_000_000_000), Battery(voltage_V=15.5, current_A=3.0)),
    Stamped(Stamp(2), AppliedPulses((1500.0,) * 8)),
    Rejected(Stamp(3), "checksum"),
    Identity("a board"),
)


def test_a_board_shows_its_battery_where_no_sensor_does(make: Make) -> None:
    bench = make(vehicle=BOARD)
    bench.node.deliver(BOARD_OUTPUTS)
    (printed,) = bench.published["battery"]
    battery = deserialized(printed, BatteryState)
    assert (battery.voltage, battery.header.stamp.sec) == (15.5, 2)
    health = bench.node.health
    assert (health.readings, health.rejects, health.identity) == (0, {"checksum": 1}, "a board")


@pytest.mark.parametrize(("device", "sensor"), [("stm32", "ina226"), ("pca9685", "ms5837")])
def test_nobody_else_shows_a_battery(make: Make, device: str, sensor: str) -> None:
    output = replace(VEHICLE.output, device=device)
    bench = make(vehicle=replace(VEHICLE, output=output, sensors={sensor: Mount(sensor)}))
    bench.node.deliver(BOARD_OUTPUTS)
    assert "battery" not in bench.published
    assert bench.node.health.identity == "a board"


def test_a_finalized_node_states_nothing_of_its_device(make: Make) -> None:
    bench = make(vehicle=BOARD)
    bench.node._wanted = State.FINALIZED  # as the service has it
    bench.node.deliver(BOARD_OUTPUTS)
    assert (bench.published["battery"], bench.node.health.identity) == ([], "")


def test_it_beats_as_long_as_somebody_reads_and_never_waits(make: Make) -> None:
    bench = make()
    os.set_blocking(bench.beat, False)
    bench.thread.beat()
    assert os.read(bench.alive, 10) == b"!"
    for _ in range(70_000):
        bench.thread.beat()
    reader, bench.alive = bench.alive, os.open(os.devnull, os.O_RDONLY)
    os.close(reader)
    bench.thread.beat()


def test_its_clock_and_its_end_are_those_of_the_thread(make: Make) -> None:
    bench = make()
    assert (bench.node.ready(), bench.node.now()) == (True, Stamp(5))
    bench.thread.ready = False
    assert not bench.node.ready()
    sent: list[str] = []
    bench.node.publish_queue.add(lambda _data: sent.append("sent"), Float32MultiArray())
    bench.node.on_idle()
    assert sent == ["sent"]
    bench.thread.calls.clear()
    bench.node.abandon()
    bench.node.close()
    assert bench.thread.calls == [("drop", "the dead man has died"), ("stop",), ("stop",)]


class Judge:
    """In the place of the judge of silence: says what the test wants, and keeps the beats."""

    verdicts: tuple[bool, ...] = (False, False, True, True, False, False, True, True)

    def __init__(self, now: Stamp, _now_s: float) -> None:
        assert now == Stamp(5)
        self.beats, self.judged, self._left = 0, threading.Event(), list(self.verdicts)

    def on_beat(self, now: Stamp, _now_s: float) -> None:
        assert now == Stamp(5)
        self.beats += 1

    def silent(self, now: Stamp, _now_s: float) -> bool:
        assert now == Stamp(5)
        verdict = self._left.pop(0) if self._left else self.verdicts[-1]
        if not self._left:
            self.judged.set()
        return verdict


def test_a_silent_dead_man_inhibits_and_a_dead_one_ends_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    life, alive = os.pipe()
    happened: list[Any] = []
    judges: list[Judge] = []
    ended = threading.Event()

    def made(now: Stamp, now_s: float) -> Judge:
        judges.append(Judge(now, now_s))
        return judges[-1]

    def killed(pid: int, number: int) -> None:
        happened.append((pid == os.getpid(), number))
        ended.set()

    def on_dead_man(*, answers: bool) -> None:
        assert threading.current_thread().daemon, "it keeps no process alive"
        happened.append(answers)

    node: Any = SimpleNamespace(now=lambda: Stamp(5), on_dead_man=on_dead_man, abandon=lambda: happened.append(None))
    monkeypatch.setattr(thrusters_node, "ParentSilence", made)
    monkeypatch.setattr(thrusters_node, "KEEPALIVE_S", 0.001)
    monkeypatch.setattr(os, "kill", killed)
    os.write(alive, b"!")
    watch_parent(life, node)
    while not judges:
        threading.Event().wait(0.001)
    assert judges[0].judged.wait(30.0)
    os.close(alive)
    assert ended.wait(30.0)
    os.close(life)
    assert happened == [False, True, False, None, (True, signal.SIGTERM)]
    assert judges[0].beats == 1


def test_the_graph_is_looked_at_more_often_than_a_command_lives() -> None:
    assert OutputGuardKnobs().command_lifespan_s > LOOK_S


def test_the_process_ends_with_the_dead_man_and_never_blocks_on_its_beat(monkeypatch: pytest.MonkeyPatch) -> None:
    life, beat = os.pipe()
    happened: list[Any] = []
    libc = SimpleNamespace(prctl=lambda *words: happened.append(words))
    monkeypatch.setattr(thrusters_node, "ctypes", SimpleNamespace(CDLL=lambda _name: libc))
    made: list[Any] = []

    def make_node(settings: Settings, to: int) -> Any:
        made.append(SimpleNamespace(name=settings.vehicle.name, beat=to, sensors=["a sensor on its line"]))
        return made[0]

    monkeypatch.setattr(thrusters_node, "ThrustersNode", make_node)
    monkeypatch.setattr(thrusters_node, "watch_parent", lambda at, node: happened.append((at, node)))

    def spin(make: Callable[[], Sequence[Any]], words: list[str]) -> int:
        happened.extend([list(make()), words])
        return 3

    monkeypatch.setattr(thrusters_node, "spin", spin)
    words = ["--ros-args", "-p", f"vehicle:={FILE}"]
    assert thrusters_node.main(words, beat, life) == 3
    (node,) = made
    nodes = [node, "a sensor on its line"]
    assert (node.name, node.beat) == ("hindrax", beat)
    assert happened == [(1, signal.SIGTERM), (life, node), nodes, ["thrusters", *words]]  # prctl(2): PR_SET_PDEATHSIG
    assert not os.get_blocking(beat)
    os.close(life)
    os.close(beat)
