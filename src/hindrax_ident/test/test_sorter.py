"""Events in order, whatever order they come in."""

import random

import pytest

from hindrax_core.events import Stamp, Stamped, stamp_from_s
from hindrax_core.signals import Phase, Thrust, Velocity
from hindrax_ident.records.sorter import StampSorter

SIX = (0.0,) * 6


def thrust(t):
    return Stamped(stamp_from_s(t), Thrust(SIX))


def play(events, wait_s=0.25):
    sorter = StampSorter(wait_s)
    out = [one for event in events for one in sorter.push(event)]
    return [*out, *sorter.flush()], sorter.dropped


@pytest.mark.parametrize("seed", range(5))
def test_delays_within_the_wait_do_not_show(seed):
    rng = random.Random(seed)
    events = [thrust(0.02 * k) for k in range(200)]
    arrival = sorted(events, key=lambda event: event.stamp / 1e9 + rng.uniform(0.0, 0.2))
    out, late = play(arrival)
    assert out == events
    assert late == 0


def test_at_one_instant_the_phase_comes_first_and_the_velocity_last():
    stamp = Stamp(5)
    velocity = Stamped(stamp, Velocity(SIX, SIX, "dvl75"))
    phase = Stamped(stamp, Phase("surge", "plateau"))
    force = Stamped(stamp, Thrust(SIX))
    for order in ([velocity, force, phase], [force, phase, velocity], [phase, velocity, force]):
        assert play(order)[0] == [phase, force, velocity]


def test_what_comes_too_late_is_counted_and_left_out():
    out, late = play([thrust(0.0), thrust(1.0), thrust(2.0), thrust(0.5)])
    assert [event.stamp for event in out] == [0, 10**9, 2 * 10**9]
    assert late == 1
