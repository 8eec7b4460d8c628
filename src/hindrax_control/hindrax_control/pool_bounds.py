"""The pool as the maneuvers see it: where the vehicle is in it, by dead reckoning, and how far the walls are.

Pool axes: x along the length, y to the right of it, from the corner; the walls are called south (x = 0), north, west
(y = 0) and east, independent of the compass. The vehicle starts at a known place, turned from the length by a known
angle, or where the operator places it later; from there on the position is that of the navigator, with its sigma.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from hindrax_core.errors import UsageError
from hindrax_core.knobs import knob
from hindrax_core.signals import NAN, Navigation
from hindrax_core.vehicle import Vehicle


@dataclass(frozen=True, slots=True)
class PoolBoundsKnobs:
    """Start of dead reckoning in the pool, and its uncertainty."""

    start_along: float = knob(0.5, 0.0, 1.0, "start of dead reckoning along the pool, as a fraction of its length [-]")
    start_across: float = knob(0.5, 0.0, 1.0, "start of dead reckoning across the pool, as a fraction of its width [-]")
    start_turned_deg: float = knob(0.0, -180.0, 180.0, "heading at the start, from the pool's length [deg]")
    start_sigma_m: float = knob(0.1, 0.0, 10.0, "standard deviation of a position that the operator gives [m]")


@dataclass(frozen=True, slots=True)
class PoolPosition:
    """Position in the pool, heading from the pool's length, its velocity in pool axes.

    `sigma_m` is the standard deviation of x and of y; NaN where it is unknown.
    """

    x_m: float
    y_m: float
    heading_rad: float
    vx_mps: float
    vy_mps: float
    sigma_m: float = NAN
    seen: tuple[bool, bool] = (True, True)
    """Whether the way along surge and along sway is measured: one sonar that looks at a wall shows one of them."""
    speed_sigma_mps: float = 0.0
    """Standard deviation of the velocity where nothing measures it now; 0 where something does, or it is unknown."""

    def off_m(self, x_m: float, y_m: float) -> float:
        """Distance from a place, along the axes that are measured."""
        along_m, across_m = self.body(x_m - self.x_m, y_m - self.y_m)
        return math.hypot(along_m, across_m)

    def body(self, x: float, y: float) -> tuple[float, float]:
        """Turn a vector of the pool into surge and sway axes; 0 along what is not measured."""
        cos, sin = math.cos(self.heading_rad), math.sin(self.heading_rad)
        return (cos * x + sin * y if self.seen[0] else 0.0, cos * y - sin * x if self.seen[1] else 0.0)


@dataclass(frozen=True, slots=True)
class GuardedPlace:
    """A place, the distance from the hull to each wall less the way that braking takes, and the least one allowed [m].

    `unplaced`: why the position of the vehicle is unknown.
    """

    place: PoolPosition
    walls_m: Mapping[str, float]
    margin_m: float
    unplaced: str = ""


class PoolBounds:
    """Pool geometry for one start, with the vehicle where the knobs place it.

    `heading_rad` and `origin_m` (north, east) are those of the navigator there.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        heading_rad: float,
        knobs: PoolBoundsKnobs | None = None,
        *,
        origin_m: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        knobs = knobs or PoolBoundsKnobs()
        pool = vehicle.pool
        self.length_m, self.width_m, self.depth_m = pool.length_m, pool.width_m, pool.depth_m
        self.half_length_m, self.half_width_m = 0.5 * vehicle.envelope_m[0], 0.5 * vehicle.envelope_m[1]
        self.axis_rad = heading_rad - math.radians(knobs.start_turned_deg)
        self.start_m = (knobs.start_along * pool.length_m, knobs.start_across * pool.width_m)
        self._start_sigma_m = knobs.start_sigma_m
        self._reckoned_m, self._variance_m2 = origin_m, 0.0

    def recentre(self, navigation: Navigation, x_m: float, y_m: float, turned_rad: float) -> None:
        """Take the vehicle to be at a place now.

        Parameters
        ----------
        navigation
            State by which it is reckoned on.
        x_m, y_m : [m]
            Along and across the pool; NaN: as it was.
        turned_rad : [rad]
            Heading from the length; NaN: as it was.

        Raises
        ------
        UsageError
            For a position outside this pool; then nothing of it may be used.
        """
        if abs(turned_rad) > math.tau:
            found = f"{math.degrees(turned_rad):.0f} deg"
            raise UsageError(f"heading: found {found}, wanted -360 to 360 deg from the pool's length")
        heading_rad, sigma_m = navigation.attitude_rad[2], navigation.position_sigma_m
        self.axis_rad = self.axis_rad if math.isnan(turned_rad) else heading_rad - turned_rad
        self.start_m = (x_m, y_m)
        self.require_inside(x_m, y_m, heading_rad - self.axis_rad)
        self._reckoned_m, self._variance_m2 = navigation.position_m, sigma_m**2 if math.isfinite(sigma_m) else 0.0

    def require_inside(self, x_m: float, y_m: float, heading_rad: float) -> None:
        """Refuse a position at which the hull is not within the pool.

        Parameters
        ----------
        x_m, y_m : [m]
            Along and across the pool.
        heading_rad : [rad]
            From the length.

        Raises
        ------
        UsageError
            Names the wall, found and wanted distance.
        """
        reach_m, extent_m = self.reach_m(heading_rad), (self.length_m, self.width_m)
        for name, at_m, half_m, whole_m in zip("xy", (x_m, y_m), reach_m, extent_m, strict=True):
            if not half_m <= at_m <= whole_m - half_m:
                wanted = f"{half_m:.2f} to {whole_m - half_m:.2f} m, the hull within the pool"
                raise UsageError(f"{name}: found {at_m:g} m, wanted {wanted}")

    def place(self, navigation: Navigation) -> PoolPosition:
        """Position by dead reckoning; velocities are NaN where the navigator has none; of only one, the other is 0."""
        north, east = (now - then for now, then in zip(navigation.position_m, self._reckoned_m, strict=True))
        cos, sin = math.cos(self.axis_rad), math.sin(self.axis_rad)
        x_m, y_m = self.start_m[0] + cos * north + sin * east, self.start_m[1] - sin * north + cos * east
        u, v, _ = navigation.velocity_mps
        seen = (True, True)
        if math.isnan(u) != math.isnan(v):
            # One sonar that looks at a wall: across its axis nothing is measured, and nothing is kept.
            seen = (not math.isnan(u), not math.isnan(v))
            u, v = (0.0 if math.isnan(one) else one for one in (u, v))
        heading = math.remainder(navigation.attitude_rad[2] - self.axis_rad, math.tau)
        cos, sin = math.cos(heading), math.sin(heading)
        vx_mps, vy_mps = cos * u - sin * v, sin * u + cos * v
        sigma_m, speed_sigma_mps = self._sigma_m(navigation), 0.0
        if not navigation.dvl_locked:
            speed_sigma_mps = max((one for one in navigation.velocity_sigma_mps[:2] if math.isfinite(one)), default=0.0)
        return PoolPosition(x_m, y_m, heading, vx_mps, vy_mps, sigma_m, seen, speed_sigma_mps)

    def _sigma_m(self, navigation: Navigation) -> float:
        """Uncertainty of the given position and of the way since then.

        A navigator that counts from there has less than before; of another one, what it had then is subtracted.
        """
        variance_m2 = navigation.position_sigma_m**2
        if variance_m2 >= self._variance_m2:
            variance_m2 -= self._variance_m2
        else:
            self._variance_m2 = 0.0
        return math.hypot(self._start_sigma_m, math.sqrt(variance_m2))

    def reach_m(self, heading_rad: float) -> tuple[float, float]:
        """Half extent of the hull along the pool's x and y at a heading from its length."""
        cos, sin = abs(math.cos(heading_rad)), abs(math.sin(heading_rad))
        a, b = self.half_length_m, self.half_width_m
        return (cos * a + sin * b, sin * a + cos * b)

    def walls_m(self, place: PoolPosition) -> dict[str, float]:
        """Distance from the hull to each wall [m]."""
        along, across = self.reach_m(place.heading_rad)
        return {
            "south": place.x_m - along,
            "north": self.length_m - place.x_m - along,
            "west": place.y_m - across,
            "east": self.width_m - place.y_m - across,
        }

    def ahead_m(self, place: PoolPosition) -> float:
        """Distance from the hull to the wall that the vehicle moves towards; to the nearest one at rest."""
        walls = self.walls_m(place)
        speed = max(abs(place.vx_mps), abs(place.vy_mps))
        if not math.isfinite(place.x_m + place.y_m + place.heading_rad):
            return NAN
        if not speed > 0.03:
            return min(walls.values())
        if abs(place.vx_mps) >= abs(place.vy_mps):
            return walls["north"] if place.vx_mps > 0.0 else walls["south"]
        return walls["east"] if place.vy_mps > 0.0 else walls["west"]
