"""Thruster processes that are frozen (SIGSTOP): whichever of them stands still, neutral is on the wire in time."""

import importlib.util
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import psutil
import pytest
from thruster_rig import Flight, World, variables, words_of

from hindrax_bringup.processes import THRUSTERS
from hindrax_bringup.stack import own_domain
from hindrax_bringup.supervisor import Supervisor
from hindrax_core.errors import HindraxError

PROMISED_S = 2.0

pytestmark = [
    pytest.mark.ros,
    pytest.mark.skipif(
        importlib.util.find_spec("hindrax_msgs") is None, reason="needs the built workspace: run ./hindrax test"
    ),
]


@dataclass(slots=True)
class SupervisedFlight:
    """A flight whose thrusters process is looked after, and what its supervisor said."""

    flight: Flight
    supervisor: Supervisor
    told: list[str] = field(default_factory=list)

    def look_after(self) -> None:
        self.told += self.supervisor.check()

    def freeze(self, who: str) -> None:
        """Stop the node, the dead man, or both."""
        node, dead_man = self.flight.take_off(), self.flight.dead_man
        for process, names in ((node, ("node", "both")), (dead_man, ("dead man", "both"))):
            if who in names:
                process.suspend()


def ended(process: psutil.Process) -> bool:
    """Whether it runs no more; its new parent may take a while to notice."""
    return not process.is_running() or process.status() == psutil.STATUS_ZOMBIE


@pytest.fixture
def supervised(tmp_path: Path) -> Iterator[SupervisedFlight]:
    with own_domain(mock=True) as domain:
        world = World(tmp_path)
        world.start()
        supervisor = Supervisor(tmp_path / "logs", variables(domain))
        with supervisor:
            supervisor.start(THRUSTERS, words_of(world))

            def handle() -> subprocess.Popen[bytes]:
                found = supervisor.children[THRUSTERS.name].handle
                assert isinstance(found, subprocess.Popen)
                return found

            flight = Flight(world, handle, domain)
            made = SupervisedFlight(flight, supervisor)
            flight.pilot.tick = made.look_after
            yield made
            flight.pilot.close()
        world.stopping.set()
        world.join()


def test_whoever_is_frozen_the_wire_is_neutral_in_time_and_it_comes_back_disarmed(supervised: SupervisedFlight) -> None:
    flight = supervised.flight

    def received(states: int) -> bool:
        return len(flight.pilot.states) > states

    for who in ("node", "dead man", "both"):
        flight.take_off()
        seen, frozen = len(supervised.told), [flight.child(), flight.dead_man]
        begin = flight.world.now
        supervised.freeze(who)
        assert flight.neutral_after(begin) <= PROMISED_S
        flight.pilot.until(partial(ended, frozen[0]), "the old node to end")
        states = len(flight.pilot.states)
        flight.pilot.until(partial(received, states + 5), "the node to come back")
        assert not any(state.armed for state in flight.pilot.states[states:])
        assert flight.is_neutral()
        told = " ".join(supervised.told[seen:])
        assert "thrusters" in told
        assert "frozen" in told


@pytest.mark.parametrize("who", ["dead man", "both"])
def test_the_end_of_the_tool_leaves_neutral_when_they_are_frozen(
    supervised: SupervisedFlight, who: str, capsys: pytest.CaptureFixture[str]
) -> None:
    supervised.freeze(who)
    old = psutil.Process(supervised.flight.child().pid)
    supervised.supervisor.close()
    assert supervised.flight.is_neutral()
    assert ended(old)
    assert "thrusters had to be killed; neutral is on the wire" in capsys.readouterr().err


def test_the_end_of_the_tool_states_when_neutral_cannot_be_written(supervised: SupervisedFlight) -> None:
    supervised.freeze("both")
    supervised.flight.world.stopping.set()
    supervised.flight.world.join()
    with pytest.raises(HindraxError, match=r"thrusters: neutral could not be written \(.*\); cut the power"):
        supervised.supervisor.close()
