"""How long thrust outlasts what it rests on: state, allocation, output guard and dead man, over random schedules.

A command carries the stamp of the state that it was made of, through every queue. So the times of the layers do not add
up: whatever waits where, and for how long, a thruster pushes by nothing that is older than the silence of the guard.
Where the process of the guard itself stands still, the dead man's time begins with that.
"""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_control.allocation.allocation_cycle import AllocationCycle
from hindrax_core.driver_interface import Output
from hindrax_core.events import Stamp, Stamped, after, seconds_between, stamp_from_s
from hindrax_core.readings import AppliedPulses
from hindrax_core.rotation import FSD
from hindrax_core.signals import AppliedOutput, Command
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.nodes.deadman import REPEAT_S, SILENT_S
from hindrax_drivers.output.output_guard import OutputGuardKnobs, Pulses, RefusedCommand, Request, guard_of
from hindrax_drivers.output.output_host import OutputHost
from hindrax_drivers.output.output_thread import BEAT_S

HINDRAX = load_vehicle(Path(__file__).parents[2] / "src/hindrax_bringup/vehicles/hindrax.yaml")
KNOBS = OutputGuardKnobs(arming_s=0.0)
GUARD = guard_of(HINDRAX, KNOBS)
WRENCH = (20.0, 0.0, 10.0, 0.0, 0.0, 0.0)
STATE_S, STEP_S, LONG_S = 0.02, 0.005, 8.0
"""Period of the states, the resolution of the schedule, and its length."""


class Wire:
    """An output whose last pulses stay, as those of a PCA9685; takes no notice of anything else."""

    def __init__(self) -> None:
        self.time, self.pulses = stamp_from_s(100.0), GUARD.neutral

    def now(self) -> Stamp:
        return self.time

    def set_up(self) -> str:
        return "wire"

    def write(self, pulses: Pulses, *, armed: bool) -> None:
        assert armed or pulses.thrusters == GUARD.neutral.thrusters
        self.pulses = pulses

    def applied(self, pulses: Pulses) -> Sequence[Stamped[AppliedPulses]]:
        return (Stamped(self.time, AppliedPulses(pulses.thrusters)),)

    def serve(self) -> Sequence[Output]:
        return ()

    def check(self, pulses: Pulses) -> None:
        del pulses

    def fault(self) -> str:
        return ""

    def left_armed(self) -> bool:
        return False

    def shut_off(self) -> None: ...

    def wait(self, until: Stamp, meanwhile: object = None) -> None: ...

    def wake(self) -> None: ...

    def close(self) -> None: ...

    @property
    def thrust(self) -> bool:
        return self.pulses.thrusters != GUARD.neutral.thrusters


class Deaf:
    """A listener that keeps nothing."""

    def applied(self, applied: AppliedOutput) -> None: ...

    def refused(self, refusal: RefusedCommand, stamp: Stamp) -> None: ...

    def found(self, identity: str) -> None: ...

    def troubled(self, text: str) -> None: ...

    def deliver(self, outputs: Iterable[Output]) -> None: ...

    def on_idle(self) -> None: ...


@dataclass(frozen=True)
class Thrust:
    """A step with thrust on the wire, the state behind it, and since when the node stands still, if it does [s]."""

    at_s: float
    state_s: float
    frozen_s: float | None


@dataclass
class Schedule:
    """Until when there are states, the delays of each, and when processes stand still; times in seconds from the start.

    Queues keep their order: of a network that delays, and of a process that was frozen, everything comes late.
    """

    silent_s: float
    to_control_s: list[float]
    to_output_s: list[float]
    control_frozen: list[tuple[float, float]] = field(default_factory=list)
    node_frozen: list[tuple[float, float]] = field(default_factory=list)
    late_s: float = 0.0
    """Of the output's thread behind its due time, and of the dead man behind his."""


def frozen(intervals: list[tuple[float, float]], at_s: float) -> bool:
    return any(begin_s <= at_s < begin_s + length_s for begin_s, length_s in intervals)


def flown(schedule: Schedule) -> list[Thrust]:
    """Fly, and return all steps with thrust."""
    wire, cycle, start = Wire(), AllocationCycle(HINDRAX), stamp_from_s(100.0)
    host = OutputHost(wire, GUARD, Deaf())  # type: ignore[arg-type]  # an output of no kind there is
    host.turn()
    assert host.arm(Request(wire.time, 1)).accepted
    due = beaten = wire.time
    dead_man_at: Stamp | None = None
    frozen_s: float | None = None
    states, commands = deque[tuple[Stamp, Stamp]](), deque[tuple[Stamp, Command]]()
    made, found = dict[int, Stamp](), list[Thrust]()
    for step in range(round(LONG_S / STEP_S)):
        now = wire.time = after(start, step * STEP_S)
        at_s = step * STEP_S
        if step % round(STATE_S / STEP_S) == 0 and at_s < schedule.silent_s:
            number = step // round(STATE_S / STEP_S)
            states.append((after(now, schedule.to_control_s[number % len(schedule.to_control_s)]), now))
        while states and states[0][0] <= now and not frozen(schedule.control_frozen, at_s):
            _, stamp = states.popleft()
            command = cycle.command(WRENCH, FSD, stamp, now)
            if command is not None:
                delay_s = schedule.to_output_s[command.sequence % len(schedule.to_output_s)]
                commands.append((after(now, delay_s), command))
                made[command.sequence] = stamp
        if frozen(schedule.node_frozen, at_s):
            frozen_s = at_s if frozen_s is None else frozen_s
        else:
            woken, frozen_s = False, None
            while commands and commands[0][0] <= now:
                host.command(commands.popleft()[1])
                woken = True
            if woken or now >= after(due, schedule.late_s) or seconds_between(beaten, now) >= BEAT_S:
                beaten, due = now, host.turn()
                dead_man_at = None
        # The dead man goes by the last beat alone, and repeats until there is another.
        silent = after(beaten, SILENT_S + schedule.late_s) if dead_man_at is None else after(dead_man_at, REPEAT_S)
        if now >= silent:
            wire.write(GUARD.neutral, armed=False)
            dead_man_at = now
        if wire.thrust:
            found.append(Thrust(at_s, seconds_between(start, made[wire.pulses.sequence]), frozen_s))
    return found


delays = st.lists(st.floats(0.0, 0.7) | st.just(0.01), min_size=1, max_size=12)
freezes = st.lists(st.tuples(st.floats(0.0, LONG_S), st.floats(0.0, 4.0)), max_size=3)


@given(
    st.builds(
        Schedule,
        silent_s=st.floats(0.0, LONG_S),
        to_control_s=delays,
        to_output_s=delays,
        control_frozen=freezes,
        node_frozen=freezes,
        late_s=st.floats(0.0, KNOBS.margin_s - 2.0 * STEP_S),
    )
)
@settings(max_examples=60, deadline=None)
def test_no_thruster_pushes_by_a_state_that_is_older_than_the_silence(schedule: Schedule) -> None:
    for one in flown(schedule):
        # The later of both ends it: where the node froze just before the silence was over, the dead man's time follows.
        since_s = one.state_s if one.frozen_s is None else one.frozen_s
        assert one.at_s - since_s <= KNOBS.silence_s
        assert one.at_s - one.state_s <= KNOBS.silence_s + SILENT_S


def test_thrust_ends_by_the_age_of_the_state_however_the_way_divides_it() -> None:
    """Without delays, and with 0.09 s at both borders: the same end after the last state, not a later one."""
    ends_s = []
    for delay_s in (0.0, 0.09):
        found = flown(Schedule(3.0, [delay_s], [delay_s]))
        assert found[0].at_s < 0.5
        ends_s.append(found[-1].at_s)
    assert max(ends_s) - 3.0 <= KNOBS.silence_s - KNOBS.margin_s
    assert max(ends_s) - min(ends_s) <= 2.0 * STEP_S


def test_a_node_that_is_frozen_is_neutral_by_its_dead_man_and_obeys_again_only_what_is_new() -> None:
    found = flown(Schedule(LONG_S, [0.01], [0.01], node_frozen=[(3.0, 2.0)]))
    last = max(one.at_s for one in found if one.at_s < 5.0)
    again = min((one for one in found if one.at_s >= 5.0), key=lambda one: one.at_s)
    assert 3.2 <= last <= 3.3, "0.3 s after the last beat"
    assert 5.0 <= again.at_s < 5.1
    assert again.at_s - again.state_s < 0.05


class ThawedWire(Wire):
    """The process is frozen with a write on its way, for so long; then that write is carried out."""

    frozen_s = 0.0

    def write(self, pulses: Pulses, *, armed: bool) -> None:
        self.time, self.frozen_s = after(self.time, self.frozen_s), 0.0
        super().write(pulses, armed=armed)


def test_a_write_that_was_frozen_on_its_way_is_taken_back_by_the_next_turn() -> None:
    wire = ThawedWire()
    pulses = (1600.0,) * len(HINDRAX.thrusters)
    host = OutputHost(wire, GUARD, Deaf())  # type: ignore[arg-type]  # as above
    host.turn()
    assert host.arm(Request(wire.time, 1)).accepted
    host.turn()
    for sequence in (1, 2):
        wire.time = after(wire.time, 0.05)
        host.command(Command(pulses, (), wire.time, sequence))
        wire.frozen_s = 3.0 * (sequence - 1)
        due = host.turn()
    assert wire.thrust
    assert due <= wire.time, "at once"
    host.turn()
    assert not wire.thrust
