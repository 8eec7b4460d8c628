"""Surge and sway by the range to a wall: the velocity and place that it shows, and where it shows none."""

import math
from dataclasses import replace

import pytest

from hindrax_control.hold.station_keeping import StationKeeping
from hindrax_control.navigation.navigator import NavigatorKnobs
from hindrax_control.navigation.wall_sonar import WallSonar
from hindrax_control.pool_bounds import PoolPosition
from hindrax_control.sensors import SensorMount
from hindrax_core.rotation import matrix
from hindrax_core.vehicle import Mount, Vehicle

STEP_S, WALL_m, HEADING_rad = 0.02, 3.0, 0.4
AHEAD, STARBOARD, PORT = (0.0, 90.0, 0.0), (-90.0, 0.0, 0.0), (90.0, 0.0, 0.0)
HALF_BEAM_rad = math.radians(12.5)


class Basin:
    """A vehicle that swings along the axis its sonar looks along, towards a wall at right angles to it."""

    def __init__(self, rotation_deg: tuple[float, float, float], lever_m: float = 0.25) -> None:
        mount = SensorMount(Mount("ping1d", rotation_deg=rotation_deg))
        self.beam = mount.axis
        lever = (lever_m * mount.axis[0], lever_m * mount.axis[1], 0.0)
        self.sonar = WallSonar(
            SensorMount(Mount("ping1d", rotation_deg=rotation_deg, position_m=lever)), NavigatorKnobs(), HALF_BEAM_rad
        )
        self.lever_m, self.position_m, self.t = lever_m, (5.0, 7.0), 0.0
        self.normal_rad = HEADING_rad + math.atan2(self.beam[1], self.beam[0])

    def swing(self, seconds: float, turned_deg: float = 0.0, *, bias_mps2: float = 0.0, echoes: bool = True) -> float:
        """Go on, and return the true velocity towards the wall at the end [m/s]."""
        rotation = matrix((0.0, 0.0, HEADING_rad + math.radians(turned_deg)))
        end = self.t + seconds
        while self.t < end:
            self.t += STEP_S
            acceleration = -0.4 * math.sin(self.t) + bias_mps2
            towards = complex(math.cos(self.normal_rad), math.sin(self.normal_rad))
            self.sonar.predict(acceleration * towards, rotation, STEP_S)
            self.position_m = self.sonar.placed(self.position_m)
            if echoes:
                self.sonar.echo(WALL_m - 0.4 * math.sin(self.t) - self.lever_m, 0.01, rotation, 0.0)
        return 0.4 * math.cos(self.t)


@pytest.mark.parametrize(("rotation_deg", "axis", "sign"), [(AHEAD, 0, 1.0), (STARBOARD, 1, 1.0), (PORT, 1, -1.0)])
def test_a_range_shows_the_velocity_along_its_axis(
    rotation_deg: tuple[float, float, float], axis: int, sign: float
) -> None:
    basin = Basin(rotation_deg)
    for seconds in (20.0, 0.8, 1.1):
        true_mps = basin.swing(seconds, bias_mps2=0.1)
        assert basin.sonar.axis == axis
        assert basin.sonar.velocity_mps() == pytest.approx(sign * true_mps, abs=0.03)


def test_the_place_follows_the_wall_and_nothing_is_said_across_it() -> None:
    basin = Basin(AHEAD)
    basin.swing(20.0)
    north, east = basin.position_m[0] - 5.0, basin.position_m[1] - 7.0
    way_m = 0.4 * math.sin(basin.t)
    assert north * math.cos(HEADING_rad) + east * math.sin(HEADING_rad) == pytest.approx(way_m, abs=0.03)
    assert north * math.sin(HEADING_rad) - east * math.cos(HEADING_rad) == pytest.approx(0.0, abs=1e-9)


def test_turned_away_it_says_nothing_and_finds_its_place_again() -> None:
    basin = Basin(AHEAD)
    basin.swing(10.0)
    assert math.isfinite(basin.sonar.velocity_mps())
    basin.swing(3.0, turned_deg=60.0)
    assert math.isnan(basin.sonar.velocity_mps())
    basin.swing(0.1, turned_deg=30.0)
    assert math.isnan(basin.sonar.velocity_mps())
    assert not basin.sonar.echo(1.0, 0.01, matrix((0.0, 0.5, HEADING_rad)), 0.0)  # looks at the surface or the floor
    basin.swing(6.0)
    ahead = (basin.position_m[0] - 5.0) * math.cos(HEADING_rad) + (basin.position_m[1] - 7.0) * math.sin(HEADING_rad)
    assert ahead == pytest.approx(0.4 * math.sin(basin.t), abs=0.03)


def test_a_heading_that_settles_takes_the_wall_along_and_leaves_the_place() -> None:
    basin = Basin(AHEAD)
    basin.swing(10.0)
    was_m = basin.position_m
    rotation = matrix((0.0, 0.0, HEADING_rad + math.radians(8.0)))
    basin.sonar.face(rotation)
    assert basin.sonar.placed(was_m) == pytest.approx(was_m, abs=1e-3)
    basin.sonar.predict(0j, matrix((0.0, 0.0, HEADING_rad + math.radians(17.0))), STEP_S)
    assert basin.sonar.echo(3.0, 0.01, rotation, 0.0)  # 9 deg from where it looked last, 17 from where first


def test_within_the_beam_a_turn_does_not_move_it() -> None:
    """The nearest point of the wall answers: the range does not grow with the cosine."""
    basin = Basin(AHEAD, lever_m=0.0)
    basin.swing(10.0, turned_deg=0.0)
    was = basin.sonar.placed((0.0, 0.0))
    basin.swing(2.0 * math.pi, turned_deg=8.0)
    now = basin.sonar.placed((0.0, 0.0))
    assert math.hypot(now[0] - was[0], now[1] - was[1]) < 0.03


def test_nothing_is_pushed_along_an_axis_that_nothing_measures(hindrax: Vehicle) -> None:
    """A place across the axis that never changes would wind up the integral, and push the vehicle into a wall."""
    station = StationKeeping(hindrax)
    here = PoolPosition(4.0, 2.0, 0.0, 0.0, 0.0, seen=(True, False))
    station.start(here)
    beside = replace(here, x_m=3.5, y_m=2.3)
    for _ in range(200):
        ahead_N, aside_N = station.step(beside, 0.1)
        assert aside_N == 0.0
    assert ahead_N > 0.0
    assert beside.off_m(4.0, 2.0) == pytest.approx(0.5)
    assert replace(beside, seen=(True, True)).off_m(4.0, 2.0) == pytest.approx(math.hypot(0.5, 0.3))
