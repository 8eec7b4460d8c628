"""Way and velocity along the axis of a sonar that looks at a wall: what a vehicle without a DVL flies surge or sway by.

A range is a place along the normal n of the wall. Pressure and depth are no different, so the filter is that of the
depth, with the acceleration along n:

    s = n p = const - range cos(max(0, slant - half beam)) - n R lever

s [m] grows towards the wall; slant is the angle between beam and normal: within its cone, the nearest point of the wall
answers, and that is the one along the normal. The walls are those of a basin: the first one is that which the axis
looks at when the thrusters first push, since a compass may be off by many degrees until it has settled; the others are
turned from it by right angles. Nothing measures the other level axis.
"""

import math
from dataclasses import replace

from hindrax_control.navigation.vertical_filter import VerticalFilter, VerticalKnobs
from hindrax_control.sensors import SensorMount
from hindrax_core.rotation import Matrix3, rotate

QUARTER_rad = 0.5 * math.pi
MOST_TURNED_rad, MOST_TILTED_rad = math.radians(10.0), math.radians(25.0)
"""Angle between axis and normal of the wall, and tilt, up to which a range is used: floor and surface are glanced at,
and the wall answers louder, until the beam is tilted by about its own width."""


class WallSonar:
    """One sonar that looks ahead or aside. Rows of a `rotation` are north, east and down in body axes."""

    def __init__(self, mount: SensorMount, knobs: VerticalKnobs, half_beam_rad: float) -> None:
        self._mount, self._knobs, self._half_beam_rad = mount, knobs, half_beam_rad
        ahead, aside, _ = mount.axis
        self.axis = 0 if abs(ahead) >= abs(aside) else 1
        """Body axis whose velocity it shows: 0 surge, 1 sway."""
        self._sign = math.copysign(1.0, mount.axis[self.axis])
        self._first_rad: float | None = None
        self._filter: VerticalFilter | None = None
        self._wall = 0
        self._began_m: dict[int, float] = {}
        self._turned_rad = 0.0
        self._position_m = (0.0, 0.0)

    def _looks_rad(self, rotation: Matrix3) -> float:
        """Direction towards the wall, from north."""
        return (
            math.atan2(rotation[1][0], rotation[0][0])
            + (0.0 if self._sign > 0.0 else math.pi)
            + self.axis * QUARTER_rad
        )

    def predict(self, acceleration_mps2: complex, rotation: Matrix3, dt_s: float) -> None:
        """Advance by an acceleration; forget the state where it looks at another wall.

        Parameters
        ----------
        acceleration_mps2 : [m/s^2]
            North + i east.
        rotation : (3, 3) [-]
            From body to north-east-down.
        dt_s : [s]
            Length of the step.
        """
        if self._first_rad is None:
            return
        looks_rad = self._looks_rad(rotation) - self._first_rad
        wall = round(looks_rad / QUARTER_rad) % 4
        self._turned_rad = math.remainder(looks_rad, QUARTER_rad)
        if wall != self._wall:
            self._filter = None
        self._wall = wall
        if self._filter is not None:
            north, east = self._normal
            self._filter.predict(north * acceleration_mps2.real + east * acceleration_mps2.imag, round(dt_s, 4))

    @property
    def _normal(self) -> tuple[float, float]:
        """North and east of the normal of the wall, towards it."""
        normal_rad = (self._first_rad or 0.0) + self._wall * QUARTER_rad
        return math.cos(normal_rad), math.sin(normal_rad)

    def face(self, rotation: Matrix3) -> None:
        """Take the wall as square to the axis as it looks now; the place stays."""
        was = self._normal
        self._first_rad, self._wall, self._turned_rad = self._looks_rad(rotation), 0, 0.0
        if 0 in self._began_m:
            moved = (now - before for now, before in zip(self._normal, was, strict=True))
            self._began_m[0] += sum(turned * at_m for turned, at_m in zip(moved, self._position_m, strict=True))

    def echo(self, range_m: float, sigma_m: float, rotation: Matrix3, delay_s: float) -> bool:
        """Fuse a range.

        Parameters
        ----------
        range_m, sigma_m : [m]
            Along the beam, and its standard deviation.
        rotation : (3, 3) [-]
            From body to north-east-down.
        delay_s : [s]
            How long ago it was valid.

        Returns
        -------
        bool
            False when it is of no use.
        """
        if self._first_rad is None:
            self.face(rotation)
        if abs(self._turned_rad) > MOST_TURNED_rad or not rotation[2][2] > math.cos(MOST_TILTED_rad):
            return False
        north, east = self._normal
        beam, lever = rotate(rotation, self._mount.axis), rotate(rotation, self._mount.lever_m)
        slant_rad = math.acos(min(1.0, north * beam[0] + east * beam[1]))
        nearest_m = range_m * math.cos(max(0.0, slant_rad - self._half_beam_rad))
        way_m = -nearest_m - north * lever[0] - east * lever[1]
        if self._filter is None:
            self._filter = VerticalFilter(self._knobs)
            at_north, at_east = self._position_m
            self._began_m.setdefault(self._wall, north * at_north + east * at_east - way_m)
        return self._filter.depth(way_m, sigma_m, delay_s)

    def velocity_mps(self) -> float:
        """Velocity of the body along its axis; NaN before a wall is seen. Motion across it counts by sin(turned)."""
        if self._filter is None:
            return math.nan
        return self._sign * self._filter.rate_mps / math.cos(self._turned_rad)

    def sigma_mps(self) -> float:
        """Standard deviation of that velocity; NaN before a wall is seen."""
        return math.nan if self._filter is None else math.sqrt(self._filter.rate_variance) / math.cos(self._turned_rad)

    def placed(self, position_m: tuple[float, float]) -> tuple[float, float]:
        """Return a position north and east with that along the normal as the wall shows it."""
        self._position_m = position_m
        if self._filter is None:
            return position_m
        (at_north, at_east), (north, east) = position_m, self._normal
        off_m = self._began_m[self._wall] + self._filter.depth_m - north * at_north - east * at_east
        return at_north + off_m * north, at_east + off_m * east


def wall_knobs(knobs: VerticalKnobs, offset_mps2: float, offset_walk: float) -> VerticalKnobs:
    """Knobs of the vertical filter with the acceleration offsets of the level ones.

    Parameters
    ----------
    knobs
        Of the vertical filter.
    offset_mps2 : [m/s^2]
        Standard deviation of the offset.
    offset_walk
        How fast it wanders.

    Returns
    -------
    VerticalKnobs
        For a filter along a wall's normal.
    """
    return replace(knobs, heave_bias_mps2=offset_mps2, heave_bias_walk=offset_walk)
