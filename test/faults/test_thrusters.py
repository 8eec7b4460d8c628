"""The thrusters process on a virtual bus: whatever dies, hangs or falls silent, neutral is on the wire in time."""

import importlib.util
import signal
from collections.abc import Iterator

import pytest
from thruster_rig import PATIENT_S, Flight, World, start, words_of

from hindrax_bringup.stack import own_domain
from hindrax_core.topics import NAMESPACE, THRUSTER_COMMAND

PROMISED_S, FROZEN_S = 0.5, 2.0

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(
        importlib.util.find_spec("hindrax_msgs") is None, reason="needs the built workspace: run ./hindrax test"
    ),
]


class Hangar:
    """Keeps one flight for many tests, because a process with ROS takes long to start; a new one when it has ended."""

    def __init__(self, folders: pytest.TempPathFactory, domain: int | None) -> None:
        self.folders, self.domain = folders, domain
        self.kept: Flight | None = None

    def flight(self) -> Flight:
        if self.kept is None or self.kept.process.poll() is not None:
            self.close()
            world = World(self.folders.mktemp("flight"))
            world.start()
            process = start(words_of(world), self.domain)
            self.kept = Flight(world, lambda: process, self.domain)
        return self.kept

    def close(self) -> None:
        if self.kept is not None:
            self.kept.close()


@pytest.fixture(scope="module")
def hangar(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Hangar]:
    with own_domain(mock=True) as domain:
        made = Hangar(tmp_path_factory, domain)
        yield made
        made.close()


@pytest.fixture
def flight(hangar: Hangar) -> Flight:
    return hangar.flight()


def test_an_old_request_does_not_arm(flight: Flight) -> None:
    flight.pilot.until(lambda: flight.pilot.states, "the output")
    answer = flight.pilot.arm(age_s=1.5)
    assert not answer.accepted
    assert "s old" in answer.reason
    flight.pilot.run(1.0)
    assert not flight.pilot.states[-1].armed


def test_a_node_that_hangs_is_neutral_in_time(flight: Flight) -> None:
    node = flight.take_off()
    begin = flight.world.now
    node.suspend()
    assert flight.neutral_after(begin) <= PROMISED_S
    node.resume()


def test_a_frozen_dead_man_is_neutral_in_time_until_it_wakes(flight: Flight) -> None:
    node, dead_man = flight.take_off(), flight.dead_man
    begin = flight.world.now
    dead_man.suspend()
    assert flight.neutral_after(begin) <= FROZEN_S
    stays_neutral(flight, "the dead man does not answer")
    dead_man.resume()
    flight.pilot.until(lambda: flight.pilot.states[-1].state == "disarmed", "the dead man to be heard")
    flight.take_off()
    assert flight.child().pid == node.pid


def test_silence_is_neutral_in_time_and_speech_moves_again(flight: Flight) -> None:
    flight.take_off()
    flight.pilot.speaking = False
    begin = flight.pilot.last_at
    assert begin is not None
    assert flight.neutral_after(begin) <= PROMISED_S
    flight.pilot.speaking = True
    flight.pilot.until(flight.is_moving, "pulses again")


def test_with_a_second_commander_neither_moves_anything_until_one_is_gone(flight: Flight) -> None:
    from rclpy.node import Node

    from hindrax_ros.graph import publisher

    flight.take_off()
    pilot = flight.pilot
    stranger = Node("stranger", namespace=NAMESPACE, context=pilot.context)
    publisher(stranger, THRUSTER_COMMAND)
    pilot.until(lambda: pilot.states[-1].state == "disarmed", "nobody to be obeyed")
    two = "thrusters/command: found 2 publishers "
    assert pilot.states[-1].reason.startswith(two)
    names = f"{two}({NAMESPACE}/pilot, {NAMESPACE}/stranger), wanted one"  # a name may come later than its publisher
    pilot.until(lambda: pilot.arm().reason == names, f"a refusal: {names}")
    assert not pilot.states[-1].armed
    pilot.run(3.0)
    assert flight.is_neutral()
    pilot.speaking = False
    stranger.destroy_node()
    pilot.until(lambda: pilot.arm().accepted, "the stranger to be gone")
    flight.take_off()


def test_a_killed_node_is_neutral_in_time_and_comes_back_disarmed(flight: Flight) -> None:
    node = flight.take_off()
    begin = flight.world.now
    node.kill()
    assert flight.neutral_after(begin) <= PROMISED_S
    seen = len(flight.pilot.states)
    flight.pilot.until(lambda: len(flight.pilot.states) > seen + 5, "the node to come back")
    assert flight.child().pid != node.pid
    assert not any(state.armed for state in flight.pilot.states[seen:])
    assert flight.is_neutral()
    flight.take_off()


def test_a_killed_dead_man_takes_the_node_along_and_leaves_neutral(flight: Flight) -> None:
    node = flight.take_off()
    begin = flight.world.now
    flight.dead_man.kill()
    flight.process.wait()
    assert flight.neutral_after(begin) <= PROMISED_S
    flight.pilot.until(lambda: not node.is_running(), "the node to end")


@pytest.mark.parametrize("label", ["deactivate", "shutdown"])
def test_out_of_active_is_neutral_in_time_and_disarmed(flight: Flight, label: str) -> None:
    node = flight.take_off()
    flight.pilot.lifecycle.refuses_the_invalid()
    flight.pilot.until(flight.is_moving, "pulses as before")
    begin = flight.world.now
    flight.pilot.lifecycle.make(label)
    assert flight.neutral_after(begin) <= PROMISED_S
    stays_neutral(flight, "on request")
    assert flight.child().pid == node.pid
    if label == "shutdown":
        retire(flight)
    else:
        flight.pilot.lifecycle.make("activate")


def test_down_to_unconfigured_and_up_again_moves_only_when_active_and_armed_anew(flight: Flight) -> None:
    flight.take_off()
    for label in ("deactivate", "cleanup", "configure"):
        flight.pilot.lifecycle.make(label)
        flight.pilot.lifecycle.refuses_the_invalid()
        stays_neutral(flight, "on request")
    flight.pilot.lifecycle.make("activate")
    flight.pilot.run(1.0)
    assert flight.is_neutral()
    flight.take_off()


@pytest.mark.parametrize("way", [["deactivate"], ["deactivate", "cleanup"]], ids=["inactive", "unconfigured"])
def test_shut_down_from_below_active_it_stays_neutral_for_good(flight: Flight, way: list[str]) -> None:
    node = flight.take_off()
    for label in (*way, "shutdown"):
        flight.pilot.lifecycle.make(label)
    flight.pilot.lifecycle.refuses_the_invalid()
    flight.pilot.run(4.0)  # longer than the dead man waits before he starts another node
    stays_neutral(flight, "only a restart of its process brings it back")
    assert flight.child().pid == node.pid
    retire(flight)


def retire(flight: Flight) -> None:
    """End a process whose node is finalized: the next test gets another one."""
    flight.dead_man.send_signal(signal.SIGTERM)
    flight.process.wait(PATIENT_S)


def stays_neutral(flight: Flight, why: str) -> None:
    """Commands go on coming, an operator asks to arm, and nothing moves; the answer says why."""
    answer = flight.pilot.arm()
    assert not answer.accepted
    assert why in answer.reason
    seen = len(flight.pilot.states)
    flight.pilot.run(1.0)
    assert flight.is_neutral()
    assert len(flight.pilot.states) > seen
    assert not any(state.armed for state in flight.pilot.states[seen:])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_neutral_and_nobody_behind(flight: Flight, number: signal.Signals) -> None:
    node = flight.take_off()
    flight.dead_man.send_signal(number)
    assert flight.process.wait(PATIENT_S) == 0
    assert flight.is_neutral()
    assert not node.is_running()


def test_a_missing_vehicle_file_is_one_sentence_and_code_2() -> None:
    process = start(["--ros-args", "-p", "vehicle:=/nowhere.yaml"], None)
    _, printed = process.communicate(timeout=PATIENT_S)
    assert process.returncode == 2
    assert printed.decode().startswith("thrusters: vehicle file /nowhere.yaml: cannot be read")
    assert len(printed.splitlines()) == 1
