"""Stop by the dead man alone: no ROS on the side of whoever stops, and none of the node when it does not obey."""

import importlib.util
import signal
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest
from thruster_rig import Flight, World, start, words_of

from hindrax_bringup.stack import own_domain
from hindrax_drivers.nodes.stop_request import StopAnswer, dead_men, stop_thrust

PROMISED_S = 1.5
"""Time of the bus, which goes at half the pace of the wall: a second for the node to obey, then the dead man writes."""

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(
        importlib.util.find_spec("hindrax_msgs") is None, reason="needs the built workspace: run ./hindrax test"
    ),
]


@pytest.fixture
def flight(tmp_path: Path) -> Iterator[Flight]:
    with own_domain(mock=True) as domain:
        world = World(tmp_path)
        world.start()
        process = start(words_of(world), domain)
        made = Flight(world, lambda: process, domain)
        yield made
        made.close()


def stopped(flight: Flight) -> StopAnswer | None:
    """Answer to a stop from another thread, while the pilot goes on to command."""
    with ThreadPoolExecutor(1) as pool:
        answer: Future[StopAnswer | None] = pool.submit(stop_thrust, flight.dead_man.pid, 30.0)
        flight.pilot.until(answer.done, "an answer to the stop")
    return answer.result()


def test_the_node_disarms_whatever_the_pilot_commands_and_arms_again(flight: Flight) -> None:
    node = flight.take_off()
    assert flight.dead_man.pid in dead_men()
    begin = flight.world.now
    assert stopped(flight) == StopAnswer(True, "disarmed")
    assert flight.is_neutral()
    assert flight.neutral_after(begin) <= PROMISED_S
    flight.pilot.until(lambda: not flight.pilot.states[-1].armed, "the state")
    assert "stopped from this machine" in flight.pilot.states[-1].reason
    assert stopped(flight) == StopAnswer(True, "disarmed"), "a stop of what has stopped is one too"
    flight.pilot.run(0.3)
    assert flight.take_off().pid == node.pid, "the node was not restarted, and can be armed again"


def test_an_arm_request_from_before_the_stop_does_not_undo_it(flight: Flight) -> None:
    flight.take_off()
    flight.pilot.run(0.8)
    assert stopped(flight) == StopAnswer(True, "disarmed")
    answer = flight.pilot.arm(age_s=0.4)
    assert not answer.accepted
    assert "before the vehicle disarmed itself" in answer.reason


def frozen(pid: int) -> bool:
    """Whether all threads stand still; on a busy host some go on for a while after the signal, and could obey."""
    stats = [stat.read_text() for stat in Path(f"/proc/{pid}/task").glob("*/stat")]
    return all(stat.rpartition(")")[2].split()[0] == "T" for stat in stats)


def test_a_node_that_does_not_obey_is_killed(flight: Flight) -> None:
    node = flight.take_off()
    begin = flight.world.now
    node.send_signal(signal.SIGSTOP)
    flight.pilot.until(lambda: frozen(node.pid), "all its threads to stand still")
    answer = stopped(flight)
    assert answer is not None
    assert answer.neutral, answer
    assert "killed because it did not disarm" in answer.sentence
    assert flight.neutral_after(begin) <= PROMISED_S
    assert node.pid != flight.child().pid
