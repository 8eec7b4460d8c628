"""Updates of the filters by DVL, pressure, sonar and compass, each at its own time of validity.

Pressure becomes depth here: (pressure - surface) / (density * gravity), at the lever of the sensor.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from hindrax_control.navigation.attitude_filter import AttitudeFilter, AttitudeKnobs
from hindrax_control.navigation.depth_drift import DepthDrift
from hindrax_control.navigation.heading_filter import HeadingFilter, HeadingKnobs
from hindrax_control.navigation.horizontal_filter import HorizontalFilter, HorizontalKnobs
from hindrax_control.navigation.hung_velocity import HungVelocity
from hindrax_control.navigation.measured_noise import MeasuredNoise
from hindrax_control.navigation.velocity_gain import VelocityGain
from hindrax_control.navigation.vertical_filter import VerticalFilter, VerticalKnobs
from hindrax_control.sensors import SensorMount
from hindrax_core.knobs import choice, knob
from hindrax_core.readings import BottomTrack, BottomVelocity, Echo, Magnetic, Pressure, Vec3
from hindrax_core.rotation import cross, rotate
from hindrax_core.vehicle import Vehicle

SHORTEST_SPAN_S = 0.02
"""A velocity without an interval is compared with the mean over this span."""
LONGEST_SPAN_S = 0.5
"""After a silence of the DVL its first velocity counts for this much time at most."""
REMEMBERED_S = 5.0
"""Time over which the way down by DVL is compared with that by pressure; what is older fades."""


@dataclass(frozen=True)
class AidingKnobs(AttitudeKnobs, HeadingKnobs, VerticalKnobs, HorizontalKnobs):
    """Trust in the sensors, those beside the IMU first."""

    heading_from: str = choice("magnetometer", ("magnetometer", "dvl", "both", "none"), "source of the heading")
    compass_tilt_deg: float = knob(15.0, 1.0, 90.0, "tilt above which the magnetometer is not used [deg]")
    dvl_heading_sigma_deg: float = knob(5.0, 0.1, 180.0, "standard deviation of the DVL's own heading [deg]")
    declination_deg: float = knob(0.0, -180.0, 180.0, "true north minus magnetic north [deg]")
    pressure_sigma_m: float = knob(
        0.003, 1e-4, 1.0, "least standard deviation of depth by pressure: beyond it counts what is measured [m]"
    )
    sonar_sigma_m: float = knob(0.01, 1e-4, 1.0, "standard deviation of the sonar at zero range [m]")
    sonar_sigma: float = knob(0.005, 0.0, 0.5, "standard deviation of the sonar as a fraction of range [-]")
    sonar_confidence: float = knob(0.5, 0.0, 1.0, "echoes below this confidence are not used [-]")
    sonar_beam_deg: float = knob(25.0, 1.0, 90.0, "opening angle of the sonar's beam [deg]")
    sonar_tilt_deg: float = knob(25.0, 1.0, 90.0, "tilt above which ranges to the floor are not used [deg]")
    dvl_altitude_after_s: float = knob(
        0.5, 0.0, 60.0, "silence of the sonar after which the DVL's altitude is used [s]"
    )
    dvl_altitude_sigma_m: float = knob(0.05, 1e-4, 1.0, "standard deviation of the DVL's altitude [m]")
    fastest_mps: float = knob(3.0, 0.1, 20.0, "velocity above which a DVL sample is rejected [m/s]")
    repeated_s: float = knob(1.0, 0.1, 60.0, "longest time for which a DVL may repeat one velocity, except at rest [s]")

    def range_sigma_m(self, range_m: float) -> float:
        """Standard deviation of a range of the sonar."""
        return math.hypot(self.sonar_sigma_m, self.sonar_sigma * range_m)


class Repetition:
    """Whether one DVL repeats itself: in motion its noise shows in the last digits, at rest it may not.

    It hangs when it has repeated one velocity for `patience_s`, or one way: over an interval of another length, the way
    of a DVL that hangs is another velocity. It is back when it has repeated nothing for as long.
    """

    def __init__(self, patience_s: float) -> None:
        self._patience_s = patience_s
        self._velocity_mps: Vec3 = (0.0, 0.0, 0.0)
        self._interval_s = 0.0
        self._changed_s = self._repeated_s = -math.inf
        self.hung = False

    def step(self, velocity_mps: Vec3, interval_s: float, valid_s: float) -> bool:
        """Compare a velocity with the last one.

        Parameters
        ----------
        velocity_mps, interval_s : (3,) [m/s], [s]
            Mean over an interval, and its length.
        valid_s : [s]
            In filter time.

        Returns
        -------
        bool
            Whether it repeats the last one.
        """
        last_mps, last_s = self._velocity_mps, self._interval_s
        self._velocity_mps, self._interval_s = velocity_mps, interval_s
        same_way = interval_s != last_s and all(
            math.isclose(now * interval_s, then * last_s) for now, then in zip(velocity_mps, last_mps, strict=True)
        )
        repeated = any(velocity_mps) and (velocity_mps == last_mps or same_way)
        if repeated:
            self._repeated_s = valid_s
        else:
            self._changed_s = valid_s
        if self.hung:
            self.hung = valid_s - self._repeated_s <= self._patience_s
        else:
            self.hung = valid_s - self._changed_s > self._patience_s
        return repeated


class Aiding:
    """The filters of one state. Compares measurements with what they expect, and lets them learn.

    Each method returns whether the measurement was used. `delay_s` is how long ago it was valid.
    """

    def __init__(self, vehicle: Vehicle, knobs: AidingKnobs) -> None:
        self._knobs = knobs
        self.attitude, self.heading = AttitudeFilter(knobs), HeadingFilter(knobs, len(vehicle.thrusters))
        self.vertical, self.horizontal = VerticalFilter(knobs), HorizontalFilter(knobs)
        self._water = vehicle.water
        self._deepest_m = 2.0 * vehicle.depth_rating_m
        self.forces_N: Sequence[float] = ()
        """Of each thruster: their currents disturb the compass."""
        self.yaw_rate_radps = 0.0
        self.place_m = (0.0, 0.0)
        """North and east of the start, by dead reckoning."""
        self.gain = VelocityGain()
        """Of the DVL's changes of velocity over those of the accelerometer."""
        self.hung = HungVelocity(knobs.hung_mps)
        self._hanging: dict[str, bool] = {}
        """Whether the last velocity of each DVL was contradicted by accelerometer and thrusters."""
        self.sunk_off_m = 0.0
        """Way down by DVL less that by pressure and accelerometer, of the last seconds."""
        self.drift = DepthDrift()
        self._noise: dict[str, MeasuredNoise] = {}
        self._sunk_s = -math.inf
        self._repetitions: dict[str, Repetition] = {}
        """Of each DVL."""

    def bottom_velocity(self, reading: BottomVelocity, mount: SensorMount, valid_s: float, source: str = "") -> bool:
        """Fuse a velocity over ground.

        Parameters
        ----------
        reading, mount
            Velocity in the axes of its sensor, and where that sits.
        valid_s : [s]
            Middle of the interval of which it is the mean, in filter time.
        source
            Name of the sensor.

        Returns
        -------
        bool
            Whether it was taken.
        """
        if reading.velocity_mps is None:
            return False
        half_s = 0.5 * max(reading.interval_s, SHORTEST_SPAN_S)
        way = self.horizontal.way(valid_s - half_s, valid_s + half_s)
        u, v, w = mount.body(reading.velocity_mps)
        fastest = self._knobs.fastest_mps
        repetition = self._repetitions.setdefault(source, Repetition(self._knobs.repeated_s))
        repeated = repetition.step(reading.velocity_mps, reading.interval_s, valid_s)
        # Without a time of the device, an equal velocity is the same one, sent again under a later stamp.
        sent_again = repeated and not reading.device_us
        if sent_again or repetition.hung or way is None or not (abs(u) <= fastest and abs(v) <= fastest):
            return False
        by_rotation = cross(way.rate_radps, mount.lever_m)
        u, v, w = u - by_rotation[0], v - by_rotation[1], w - by_rotation[2]
        self._compare_sinking((u, v, w), valid_s)
        (a, b, c), (d, e, f), _ = self.attitude.rotation
        over_ground = complex(a * u + b * v + c * w, d * u + e * v + f * w)
        self.gain.measured(over_ground, valid_s)
        still, hangs = self.gain.shows_little, self._hanging.get(source, False)
        used = self.horizontal.fuse(u, v, reading.sigma_mps, way, repeated=repeated, still=still, hangs=hangs)
        # An outlier would count as a change for three times.
        if (used or hangs) and (ahead := self.attitude.ahead):
            self._hanging[source] = self.hung.contradicts(over_ground * ahead.conjugate(), valid_s, source)
        return used

    def _compare_sinking(self, velocity_mps: Vec3, valid_s: float) -> None:
        """Compare the way down by the DVL with that by pressure and accelerometer."""
        # The rate by pressure means nothing before the noise of the pressure is known: two samples make it.
        if any(noise.known for noise in self._noise.values()):
            dx, dy, dz = self.attitude.rotation[2]
            u, v, w = velocity_mps
            span_s = min(valid_s - self._sunk_s, LONGEST_SPAN_S)
            off_mps = dx * u + dy * v + dz * w - self.vertical.rate_mps
            self.sunk_off_m += span_s * (off_mps - self.sunk_off_m / REMEMBERED_S)
            self.drift.step(off_mps, math.hypot(u, v), span_s)
        self._sunk_s = valid_s

    def pressure(self, reading: Pressure, mount: SensorMount, delay_s: float, source: str = "") -> bool:
        """Fuse the depth that a pressure means, as sure as its noise lets it be.

        Parameters
        ----------
        reading, mount
            Pressure, and where the sensor sits.
        delay_s : [s]
            How long ago it was valid.
        source
            Name of the sensor.

        Returns
        -------
        bool
            Whether it was taken.
        """
        depth_m = self._water.depth_m(reading.pressure_Pa)
        if not abs(depth_m) <= self._deepest_m:
            return False
        noise = self._noise.setdefault(source, MeasuredNoise(self._knobs.pressure_sigma_m))
        return self.vertical.depth(depth_m - self._below(mount.lever_m), noise.step(depth_m), delay_s)

    def compare_floor(self, reading: Pressure, valid_s: float) -> None:
        """Compare the floor with that of an earlier visit, as depth and altitude give it at a pressure."""
        self.drift.pressure(reading.pressure_Pa, valid_s)
        self.drift.floor(self.vertical.floor_m, self.place_m, valid_s)

    def echo(self, reading: Echo, mount: SensorMount, delay_s: float) -> bool:
        """Fuse the range of the sonar: the nearest point of the floor within its beam answers.

        Parameters
        ----------
        reading, mount
            Range, and where the sensor sits and looks.
        delay_s : [s]
            How long ago it was valid.

        Returns
        -------
        bool
            Whether it was taken.
        """
        knobs = self._knobs
        if not reading.confidence >= knobs.sonar_confidence:
            return False
        sigma_m = knobs.range_sigma_m(reading.range_m)
        return self._range(reading.range_m, sigma_m, 0.5 * math.radians(knobs.sonar_beam_deg), mount, delay_s)

    def _range(self, range_m: float, sigma_m: float, half_beam_rad: float, mount: SensorMount, delay_s: float) -> bool:
        dx, dy, dz = self.attitude.rotation[2]
        ax, ay, az = mount.axis
        tilt = math.acos(min(1.0, max(-1.0, dx * ax + dy * ay + dz * az)))
        if not (tilt <= math.radians(self._knobs.sonar_tilt_deg) and 0.0 < range_m < math.inf):
            return False
        height_m = range_m * math.cos(max(0.0, tilt - half_beam_rad))
        return self.vertical.altitude(height_m + self._below(mount.lever_m), sigma_m, delay_s)

    def magnetic(self, reading: Magnetic, mount: SensorMount, delay_s: float) -> bool:
        """Fuse the heading that a magnetic field means.

        Parameters
        ----------
        reading, mount
            Field in the axes of its sensor, and how that is turned.
        delay_s : [s]
            How long ago it was valid.

        Returns
        -------
        bool
            Whether it was taken.
        """
        knobs, attitude = self._knobs, self.attitude
        if knobs.heading_from not in ("magnetometer", "both"):
            return False
        down = attitude.rotation[2]
        if self.heading.known and down[2] < math.cos(math.radians(knobs.compass_tilt_deg)):
            return False
        north, east, _ = rotate(attitude.rotation, mount.body(reading.field_T))
        heading_rad = attitude.heading_rad
        cos, sin = math.cos(heading_rad), math.sin(heading_rad)
        # Leveled axes that look where the body looked when the field was measured.
        x, y = cos * north + sin * east, cos * east - sin * north
        then_rad = heading_rad - self.yaw_rate_radps * delay_s - math.radians(knobs.declination_deg)
        if not 0.0 < x * x + y * y < math.inf:
            return False
        correction = self.heading.magnetic(x, y, then_rad, self.forces_N)
        if correction is None:
            return False
        attitude.steer(*correction)
        return True

    def dvl_heading(self, reading: BottomTrack, delay_s: float) -> bool:
        """Fuse the DVL's own heading, where asked for."""
        knobs = self._knobs
        digits = reading.imu_calibration
        calibrated = len(digits) != 4 or digits[3] in "23"
        steered = knobs.heading_from in ("dvl", "both") and calibrated and math.isfinite(reading.heading_rad)
        if steered:
            off_rad = reading.heading_rad + self.yaw_rate_radps * delay_s - self.attitude.heading_rad
            sigma_deg = knobs.dvl_heading_sigma_deg
            self.attitude.steer(*self.heading.heading(math.remainder(off_rad, math.tau), sigma_deg))
        return steered

    def dvl_altitude(self, altitude_m: float, mount: SensorMount, delay_s: float) -> bool:
        """Fuse the altitude along the axis of a DVL.

        Parameters
        ----------
        altitude_m : [m]
            Along the axis.
        mount
            Where the sensor sits and looks.
        delay_s : [s]
            How long ago it was valid.

        Returns
        -------
        bool
            Whether it was taken.
        """
        return self._range(altitude_m, self._knobs.dvl_altitude_sigma_m, 0.0, mount, delay_s)

    def _below(self, lever_m: Vec3) -> float:
        """Depth of a point of the vehicle below its origin."""
        dx, dy, dz = self.attitude.rotation[2]
        lx, ly, lz = lever_m
        return dx * lx + dy * ly + dz * lz
