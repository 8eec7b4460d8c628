"""A DVL hangs where accelerometer and thrusters contradict it together, and nowhere else."""

import cmath

import pytest

from hindrax_control.navigation.hung_velocity import HungVelocity
from hindrax_control.navigation.past_sums import PastSums

TICK_S, PUSHED_S = 0.02, 6.0


def hung(
    *,
    gathers_mps2: complex = 0.13,
    accelerometer: float = 1.0,
    thrust: float = 1.0,
    offset_mps2: complex = 0j,
    current_mps2: complex = 0j,
    stuck: bool = True,
    turning_radps: float = 0.0,
    every: int = 3,
    told_until_s: float = 99.0,
) -> bool:
    """Whether a DVL is found to hang at any time in 5 s of gathering speed, in axes that do not turn.

    `accelerometer` and `thrust` are the shares of it that the witnesses show; after `told_until_s` one is missing.
    """
    detector, velocity, shown, ahead, found = HungVelocity(0.15), 0.2 + 0j, 0j, 1.0 + 0j, False
    for tick in range(1, 550):
        now_s = tick * TICK_S
        change = gathers_mps2 * TICK_S * (now_s > PUSHED_S)
        velocity += change
        level = change / ahead
        by_accelerometer = accelerometer * level + offset_mps2 * TICK_S
        by_thrust = thrust * level + current_mps2 / ahead * TICK_S
        if now_s < told_until_s:
            detector.changed(by_accelerometer, by_thrust, turning_radps * TICK_S, now_s)
        else:
            detector.forget()
        ahead *= cmath.rect(1.0, turning_radps * TICK_S)
        if tick % every == 0:
            shown = shown if stuck and now_s > PUSHED_S else velocity / ahead
            noise = 0.01 * cmath.exp(1j * tick**2)
            found |= detector.contradicts(shown + noise, now_s, "dvl75")
    return found


@pytest.mark.parametrize("gathers", [0.13, -0.13, 0.13j, 0.1 - 0.1j])
@pytest.mark.parametrize("turning", [0.0, 0.5])
def test_a_dvl_hangs_that_shows_nothing_of_what_both_witnesses_show(gathers: complex, turning: float) -> None:
    how = {"gathers_mps2": gathers, "turning_radps": turning, "offset_mps2": 0.1 - 0.1j, "current_mps2": -0.1 + 0j}
    assert hung(**how)  # type: ignore[arg-type]
    assert not hung(**how, stuck=False)  # type: ignore[arg-type]


def test_a_velocity_that_stays_in_the_axes_of_a_turning_vehicle_hangs() -> None:
    assert hung(gathers_mps2=0j, turning_radps=0.5)
    assert not hung(gathers_mps2=0j, turning_radps=0.5, stuck=False)


@pytest.mark.parametrize(("accelerometer", "thrust"), [(1.0, 0.0), (0.0, 1.0), (1.0, -1.0)])
def test_one_witness_alone_proves_nothing(accelerometer: float, thrust: float) -> None:
    assert not hung(accelerometer=accelerometer, thrust=thrust)


def test_witnesses_that_err_evenly_prove_nothing() -> None:
    assert not hung(gathers_mps2=0j, offset_mps2=0.3 + 0j, current_mps2=0.3 + 0j, stuck=False)


def test_it_begins_again_after_a_silence_and_where_a_witness_is_missing() -> None:
    assert not hung(every=60)
    assert not hung(told_until_s=PUSHED_S + 0.5)


def test_sums_are_found_at_a_time_of_the_past_and_forgotten_after_a_while() -> None:
    sums = PastSums(2, memory_s=1.0)
    for tick in range(1, 11):
        sums.add((1.0 + 0j, 2j), 0.2 * tick)
    assert sums.at(1.5) == pytest.approx((7.5, 15j))
    assert sums.at(2.0) == (10.0, 20j)
    assert sums.at(0.7) is None
    assert sums.at(2.1) is None
