"""Events in order, whatever order they come in."""

import random
from typing import Any

import pytest

from hindrax_core.events import Stamp, Stamped, stamp_from_s
from hindrax_core.signals import Phase, Thrust, Velocity
from hindrax_ident.records.feed import StampSorter

SIX = (0.0,) * 6


def thrust(t: float) -> Stamped[Any]:
    return Stamped(stamp_from_s(t), Thrust(SIX))


def play(events: list[Stamped[object]], wait_s: float = 0.25, lag_s: float = 0.0) -> tuple[list[Stamped[Any]], int]:
    sorter: StampSorter[Any] = StampSorter(wait_s, lag_s)
    out = [one for event in events for one in sorter.push(event)]
    return [*out, *sorter.flush()], sorter.dropped


@pytest.mark.parametrize("seed", range(5))
def test_delays_within_the_wait_do_not_show(seed: int) -> None:
    rng = random.Random(seed)
    events = [thrust(0.02 * k) for k in range(200)]
    arrival = sorted(events, key=lambda event: event.stamp / 1e9 + rng.uniform(0.0, 0.2))
    out, late = play(arrival)
    assert out == events
    assert late == 0


def test_at_one_instant_the_phase_comes_first_and_the_velocity_last() -> None:
    stamp = Stamp(5)
    velocity = Stamped(stamp, Velocity(SIX, "dvl75"))
    phase = Stamped(stamp, Phase("surge", "plateau"))
    force = Stamped(stamp, Thrust(SIX))
    for order in ([velocity, force, phase], [force, phase, velocity], [phase, velocity, force]):
        assert play(order)[0] == [phase, force, velocity]


def test_what_comes_too_late_is_counted_and_left_out() -> None:
    out, late = play([thrust(0.0), thrust(1.0), thrust(2.0), thrust(0.5)])
    assert [event.stamp for event in out] == [0, 10**9, 2 * 10**9]
    assert late == 1


def velocity(t: float) -> Stamped[Velocity]:
    return Stamped(stamp_from_s(t), Velocity(SIX, "dvl"))


def test_a_kind_that_lags_behind_on_a_busy_machine_is_waited_for() -> None:
    forces, velocities = [thrust(0.1 * k) for k in range(60)], [velocity(0.1 * k) for k in range(60)]
    together = [one for pair in zip(forces, velocities, strict=True) for one in pair]
    lagging = [*together[:20], *forces[10:50], *velocities[10:50], *together[100:]]
    assert play(lagging, lag_s=5.0) == (together, 0)
    assert play(lagging)[1] > 0


def test_a_backlog_that_comes_topic_by_topic_is_sorted_at_once() -> None:
    forces, velocities = [thrust(0.1 * k) for k in range(60)], [velocity(0.1 * k) for k in range(60)]
    together = [one for pair in zip(forces, velocities, strict=True) for one in pair]
    assert play([*forces, *velocities])[1] > 0
    sorter: StampSorter[Thrust | Velocity] = StampSorter(0.25)
    assert [*sorter.push(*forces, *velocities), *sorter.flush()] == together
    assert sorter.dropped == 0


def test_a_kind_that_is_silent_does_not_stop_the_others() -> None:
    sorter: StampSorter[Thrust | Velocity] = StampSorter(0.25, lag_s=5.0)
    out = [one for event in (velocity(0.0), *(thrust(0.1 * k) for k in range(1, 100))) for one in sorter.push(event)]
    assert out[-1].stamp >= stamp_from_s(9.6)
