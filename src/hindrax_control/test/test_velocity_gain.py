"""A DVL that is turned or scaled shows in a push, and nothing else looks like it."""

import cmath
import math

import pytest

from hindrax_control.navigation.estimator_health import EstimatorHealth
from hindrax_control.navigation.velocity_gain import UNKNOWN, Gain, VelocityGain, described
from hindrax_core.events import Stamp, stamp_from_s
from hindrax_core.signals import Consistency, Navigation
from hindrax_core.vehicle import Vehicle

TICK_S = 0.02


def flown(gain: complex, *, offset_mps2: complex = 0j, yaw_rate_radps: float = 0.0, push_mps: float = 0.4) -> Gain:
    """Gain after five pushes back and forth with a lag of 0.7 s, a DVL at 10 Hz; the offset is fixed in the vehicle."""
    estimator, velocity = VelocityGain(), 0j
    for tick in range(1, 2000):
        now_s = tick * TICK_S
        wanted = push_mps * (1.0 if int(now_s / 8.0) % 2 else -1.0)
        change = (wanted - velocity) / 0.7 * TICK_S
        velocity += change
        turned = cmath.exp(1j * yaw_rate_radps * now_s)
        estimator.accelerated(change + turned * offset_mps2 * TICK_S, yaw_rate_radps, now_s)
        if tick % 5 == 0:
            noise = 0.005 * cmath.exp(1j * tick**2)
            estimator.measured(gain * velocity + noise, now_s - 0.05)
    return estimator.gain


@pytest.mark.parametrize("gain", [1.0, 1.5, 0.6, 1j, -1.0, cmath.exp(0.6j)])
@pytest.mark.parametrize("offset", [0j, 0.2 + 0.1j])
def test_scale_and_mount_of_the_dvl_are_found_whatever_the_accelerometer_adds(gain: complex, offset: complex) -> None:
    found = flown(gain, offset_mps2=offset)
    assert abs(found.value - gain) < 0.12 * abs(gain)
    assert found.sigma < 0.2


def test_what_did_not_move_shows_nothing() -> None:
    assert flown(1.0, push_mps=0.0) == UNKNOWN
    assert VelocityGain().gain == UNKNOWN


@pytest.mark.parametrize("rate", [0.25, 0.6, 1.2])
def test_a_vehicle_that_turns_on_the_spot_carries_its_offset_around_and_shows_nothing(rate: float) -> None:
    assert flown(1.0, offset_mps2=0.4 + 0j, yaw_rate_radps=rate, push_mps=0.0) == UNKNOWN


def test_late_and_repeated_velocities_are_left_out() -> None:
    estimator = VelocityGain()
    for tick in range(1, 100):
        estimator.accelerated(0.01 + 0j, 0.0, tick * TICK_S)
    for valid_s in (1.5, 1.5, 0.2, 9.0):
        estimator.measured(1.0 + 0j, valid_s)
    assert estimator.gain == UNKNOWN


def judged(vehicle: Vehicle, consistency: Consistency) -> tuple[str, ...]:
    health = EstimatorHealth(vehicle)
    found: tuple[str, ...] = ()
    state = Navigation(
        attitude_rad=(0.0, 0.0, 0.0), rate_radps=(0.0, 0.0, 0.0), velocity_mps=(0.3, 0.0, 0.0), depth_m=1.0,
        altitude_m=2.0, position_m=(0.0, 0.0), dvl_locked=True, ages_s={}, consistency=consistency,
    )  # fmt: skip
    for tick in range(20):
        found = health.step(state, Stamp(stamp_from_s(1.0 + tick * TICK_S)), armed=True)
    return found


@pytest.mark.parametrize(
    ("gain", "sigma", "wrong"),
    [
        (1.5 + 0j, 0.1, True),
        (1j, 0.3, True),
        (1.3 + 0j, 0.05, False),
        (1.5 + 0j, 0.2, False),
        (0j, math.inf, False),
    ],
)
def test_a_gain_beyond_doubt_ends_thrust(vehicle: Vehicle, gain: complex, sigma: float, wrong: bool) -> None:
    found = judged(vehicle, Consistency(velocity_gain=gain, velocity_gain_sigma=sigma))
    assert bool(found) is wrong
    if wrong:
        assert found[0].startswith(f"gain: changes of velocity by the DVL are {described(gain)}")
        assert "check the DVL's mount and scale" in found[0]


def test_velocities_that_are_refused_end_thrust_before_the_filter_gives_in(vehicle: Vehicle) -> None:
    assert judged(vehicle, Consistency(refused_velocities=7)) == ()
    assert judged(vehicle, Consistency(refused_velocities=8))[0].startswith("velocity: 8 velocities of the DVL")
    assert judged(vehicle, Consistency(refused_depths=19)) == ()
