"""What the navigator says of the error of its position holds for the errors that are believed, and grows with them."""

import math
import random
from itertools import pairwise

import pytest

from hindrax_control.navigation.horizontal_filter import PositionKnobs, PositionUncertainty
from hindrax_control.navigation.navigator import Navigator
from hindrax_core.events import Stamped, stamp_from_s
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import BottomVelocity, Inertial
from hindrax_core.signals import Navigation
from hindrax_core.vehicle import Vehicle

PRIOR = PositionKnobs()


def test_errors_of_the_assumed_size_are_as_large_as_it_states() -> None:
    """Vehicles that fly out, turn and come back, each with errors of its own: mean of error squared over variance."""
    draws, ratios = random.Random(5), []
    for _ in range(400):
        bias = [draws.gauss(0.0, PRIOR.dvl_bias_mps) for _ in range(2)]
        scale, turn = (draws.gauss(0.0, PRIOR.dvl_share) for _ in range(2))
        uncertainty, error = PositionUncertainty(PRIOR), [0.0, 0.0]
        for second in range(200):
            heading_rad = 0.0 if second < 60 else 1.5 if second < 120 else 3.0
            cos, sin = math.cos(heading_rad), math.sin(heading_rad)
            u, v = (0.3 if second < 90 else -0.1), 0.05
            u_off, v_off = (value + draws.gauss(0.0, 0.01) for value in (bias[0] + scale * u, bias[1] + scale * v))
            u_off, v_off = u_off - turn * v, v_off + turn * u
            error = [error[0] + cos * u_off - sin * v_off, error[1] + sin * u_off + cos * v_off]
            uncertainty.move(heading_rad, cos * u - sin * v, sin * u + cos * v, 1.0)
            uncertainty.measured(0.01, 1.0)
        ratios += [one * one / uncertainty.sigma_m**2 for one in error]
    assert sum(ratios) / len(ratios) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("heading_rad", [0.0, 1.5, -2.0])
def test_turning_around_takes_a_bias_back_and_coming_back_an_error_of_scale(heading_rad: float) -> None:
    bias, scale = PositionUncertainty(PositionKnobs(0.01, 0.0)), PositionUncertainty(PositionKnobs(0.0, 0.02))
    for uncertainty in (bias, scale):
        uncertainty.move(heading_rad, 3.0, 4.0, 100.0)
    assert (bias.sigma_m, scale.sigma_m) == pytest.approx((1.0, 0.1))
    for uncertainty in (bias, scale):
        uncertainty.move(heading_rad + math.pi, -3.0, -4.0, 100.0)
    assert (bias.sigma_m, scale.sigma_m) == pytest.approx((0.0, 0.0), abs=1e-9)


def test_noise_adds_up_by_its_square_and_an_unmeasured_velocity_by_itself() -> None:
    noise, unmeasured = (PositionUncertainty(PositionKnobs(0.0, 0.0)) for _ in range(2))
    for _ in range(100):
        noise.measured(0.02, 0.5)
        unmeasured.unmeasured(0.02, 0.5)
    assert (noise.sigma_m, unmeasured.sigma_m) == pytest.approx((0.1, 1.0))


def flown(navigator: Navigator, dvl: tuple[tuple[float, float], ...], until_s: float) -> list[float]:
    """What it says of its position at every tick, at rest, with a DVL that speaks in these spans [s]."""
    sigmas_m: list[float] = []
    for number in range(1, round(100 * until_s)):
        time_s = 0.01 * number
        found: Stamped[Navigation] | None = None
        if not 30.0 < time_s < 32.0 or until_s < 40.0:  # a gap of the inertial sensor, in the longest flight
            inertial = Inertial((0.0, 0.0, -GRAVITY_mps2), (1e-9 * number, 0.0, 0.0), 20.0)
            found = navigator.step(Stamped(stamp_from_s(time_s), inertial), "icm20948")
        if number % 10 == 0 and any(begin <= time_s < end for begin, end in dvl):
            still = BottomVelocity((0.0, 0.0, 0.0), 0.01, 1.0, 0.1, 0)
            navigator.step(Stamped(stamp_from_s(time_s), still), "dvl75")
        if found is not None:
            sigmas_m.append(found.reading.position_sigma_m)
    return sigmas_m


def test_the_navigator_states_how_far_off_it_may_be_and_begins_anew_when_it_is_given(hindrax: Vehicle) -> None:
    navigator = Navigator(hindrax)
    sigmas_m = flown(navigator, ((3.0, 99.0),), 20.0)
    assert math.isnan(sigmas_m[0])  # no velocity yet
    known = [one for one in sigmas_m if not math.isnan(one)]
    assert all(after > before for before, after in pairwise(known))
    assert PRIOR.dvl_bias_mps * 16.0 < known[-1] < 1.2 * PRIOR.dvl_bias_mps * 18.0
    navigator.confirm_position()
    inertial = Inertial((0.0, 0.0, -GRAVITY_mps2), (0.0, 0.0, 1e-7), 20.0)
    found = [navigator.step(Stamped(stamp_from_s(20.0 + 0.01 * k), inertial), "icm20948") for k in range(3)]
    assert next(one.reading.position_sigma_m for one in found if one is not None) < 0.001


def test_without_a_lock_or_after_a_gap_it_knows_less(hindrax: Vehicle) -> None:
    always = flown(Navigator(hindrax), ((0.0, 99.0),), 28.0)[-1]
    lost = flown(Navigator(hindrax), ((0.0, 10.0), (20.0, 99.0)), 28.0)[-1]
    gap = flown(Navigator(hindrax), ((0.0, 99.0),), 45.0)[-1]
    assert lost > 1.5 * always
    assert gap > hindrax.limits.speed_mps * 2.0
