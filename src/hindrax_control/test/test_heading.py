"""The compass filter alone: what it learns, and what it refuses to learn."""

import math
import random
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hindrax_control.navigation.heading_filter import FIRST, HeadingFilter, HeadingKnobs
from hindrax_core.readings import Vec3

KNOBS = HeadingKnobs(compass_sigma_deg=1.0)
STRENGTH_T = 18e-6
MOTORS = ((0.010, -0.004), (-0.006, 0.008), (0.003, 0.005))
"""Field of each thruster per N^1.5, in units of the earth's horizontal field."""
FIXED = (0.02, -0.03)


def field(heading: float, forces: Vec3, noise: float = 0.0, draw: random.Random | None = None) -> tuple[Any, Any]:
    x = math.cos(heading) + FIXED[0] + sum(k[0] * abs(f) ** 1.5 for k, f in zip(MOTORS, forces, strict=True))
    y = -math.sin(heading) + FIXED[1] + sum(k[1] * abs(f) ** 1.5 for k, f in zip(MOTORS, forces, strict=True))
    rough = draw or random.Random(0)
    return STRENGTH_T * (x + rough.gauss(0.0, noise)), STRENGTH_T * (y + rough.gauss(0.0, noise))


class Flight:
    """A caller that keeps heading and bias, as the navigator does."""

    def __init__(self, thrusters: int = 3) -> None:
        self.filter, self.heading, self.bias = HeadingFilter(KNOBS, thrusters), 0.0, 0.0
        self.random = random.Random(2)

    def fly(
        self,
        seconds: float,
        true_heading: Callable[[Any], float],
        forces: Callable[[Any], Vec3],
        *,
        gyro_bias: float = 0.0,
        reported: bool = True,
    ) -> None:
        """True heading and forces are functions of time; the gyroscope turns by the true rate and its bias."""
        for number in range(round(seconds * 25)):
            t = number / 25.0
            turned = true_heading(t + 0.04) - true_heading(t) + 0.04 * gyro_bias
            self.heading += turned - 0.04 * self.bias
            self.filter.predict(0.04)
            now = forces(t)
            x, y = field(true_heading(t + 0.04), now, 0.01, self.random)
            found = self.filter.magnetic(x, y, self.heading, now if reported else ())
            if found is not None:
                self.heading += found[0]
                self.bias += found[1]


def steps(t: float) -> Vec3:
    turn = int(t / 1.5)
    return (4.0 * (turn % 2), 6.0 * (turn // 2 % 2), 8.0 * (turn // 4 % 2))


def test_it_learns_the_field_of_every_thruster() -> None:
    flight = Flight()
    flight.fly(3.0, lambda _: 0.0, lambda _: (0.0, 0.0, 0.0))
    flight.fly(60.0, lambda _: 0.0, steps)
    # The strength of the first field includes what is fixed in the vehicle.
    unit = math.degrees(1.0) / math.hypot(1.0 + FIXED[0], FIXED[1])
    along_x, along_y = np.degrees(flight.filter._fields[FIRST:]).reshape(2, -1)
    for *found, truth in zip(along_x, along_y, MOTORS, strict=True):
        assert found == pytest.approx((truth[0] * unit, truth[1] * unit), abs=0.05)


def test_a_turn_shows_what_is_fixed_in_the_vehicle_from_the_heading() -> None:
    flight = Flight()
    flight.fly(4.0, lambda _: 0.0, lambda _: (0.0, 0.0, 0.0))
    before = abs(math.degrees(flight.heading))
    flight.fly(60.0, lambda t: 0.3 * t, lambda _: (0.0, 0.0, 0.0))
    after = abs(math.degrees(flight.heading - 0.3 * 60.0))
    assert before > 1.0
    assert after < 0.5


def test_it_finds_the_bias_of_the_gyroscope() -> None:
    flight = Flight()
    flight.fly(40.0, lambda _: 0.4, lambda _: (0.0, 0.0, 0.0), gyro_bias=0.002)
    assert flight.bias == pytest.approx(0.002, abs=3e-4)


def test_its_uncertainty_shrinks_by_measuring_and_grows_by_waiting() -> None:
    flight = Flight()
    flight.fly(5.0, lambda _: 0.0, lambda _: (0.0, 0.0, 0.0))
    known = math.sqrt(flight.filter._P[0, 0])
    flight.filter.predict(600.0)
    flight.filter.heading(0.0, 90.0)
    assert math.sqrt(flight.filter._P[0, 0]) > 1.5 * known


def test_the_first_heading_of_any_kind_is_taken_as_it_is() -> None:
    assert HeadingFilter(KNOBS, 3).heading(0.7, 5.0) == (0.7, 0.0)
    x, y = field(1.2, (0.0, 0.0, 0.0))
    found = HeadingFilter(KNOBS, 3).magnetic(x, y, 0.0, ())
    assert found is not None
    assert found[0] == pytest.approx(math.atan2(-y, x), abs=1e-9)


def test_an_outlier_is_refused_until_it_is_the_rule() -> None:
    flight = Flight(0)
    for _ in range(50):
        flight.filter.magnetic(STRENGTH_T, 0.0, 0.0, ())
    refused = 0
    while flight.filter.magnetic(STRENGTH_T, 0.6 * STRENGTH_T, 0.0, ()) is None:
        refused += 1
    assert refused == KNOBS.compass_patience
