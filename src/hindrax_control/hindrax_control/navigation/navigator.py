"""The navigator: all sensors in, one Navigation at 50 Hz of IMU time out. Pure; every stamp is respected.

The IMU drives it: each sample only adds to sums, and at every tick the sums go through the attitude, the vertical and
the horizontal filter. What other sensors measured waits until the next tick and is fused at its own time of validity.

Symbols: SNAME axes of the body, origin at the body origin. f specific force, what an accelerometer measures:
acceleration less gravity [m/s^2]; omega = (p, q, r) rates, (bp, bq, br) offsets of the gyroscope; u v w velocities in
the body. R rotates from the body to north, east, down; its last row d = (dx, dy, dz) is "down" in the body, so

    v' = f + g d - omega x v     (velocity over ground, in axes that turn)
    down rate = d . (u, v, w),   north and east rate by the other rows
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

from hindrax_control.navigation.aiding import SHORTEST_SPAN_S, Aiding, AidingKnobs
from hindrax_control.navigation.attitude_filter import SPANS, Offset, Span, mean, offset_at_rest
from hindrax_control.navigation.horizontal_filter import PositionKnobs, PositionUncertainty
from hindrax_control.navigation.thrust_model import ThrustModel
from hindrax_control.navigation.wall_sonar import WallSonar, wall_knobs
from hindrax_control.sensors import NOWHERE, SensorMount, why_impossible
from hindrax_core.events import EARLIEST, NS_PER_S, Stamp, Stamped, after
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.input_checks import Refusals
from hindrax_core.knobs import knob
from hindrax_core.readings import BottomTrack, BottomVelocity, Echo, Inertial, Magnetic, Pressure, Reading, Vec3
from hindrax_core.rotation import cross
from hindrax_core.sensor_table import row_of
from hindrax_core.signals import NAN, ZERO6, Consistency, Navigation
from hindrax_core.text.refusals import NOTHING, Reason, Refusal, refused
from hindrax_core.vehicle import Vehicle

LEAST_UPRIGHT = 0.3
"""Cosine of tilt below which the downward velocity determines heave too poorly."""
MOST_WAITING = 200
OTHER_CLOCK_S = 10.0
"""Later than any measurement comes: stamps of two sensors this far apart are of two clocks."""
AHEAD_S, AHEAD_TIMES = 1.0, 20
"""No inertial sample comes so late that another sensor leads it by this time and again."""
STEPPED_BACK = 100
"""Samples in a row whose stamps do not go on from the last: no disorder, the clock was set back."""
GRAVITY_BOUNDS_mps2 = (8.0, 12.0)
"""Mean specific force at the start: less or more is of another unit, or gravity was taken off."""
AT_REST_radps = 0.005
"""Rates beyond its offset within which a sensor of coarse steps repeats its samples."""
STEADY_TURN_S, STEPS_rad = 1.0, 0.005
"""Time for which it may repeat them in a steady turn about the vertical, and the turn of gravity that it must show.

An autopilot's steps are 1 mg and 1 mrad/s, and its noise after its filter may be a tenth of that: simulated ones
repeated a sample for up to 0.42 s while they turned.
"""


@dataclass(frozen=True)
class NavigatorKnobs(AidingKnobs, PositionKnobs):
    """Trust in the sensors; the vehicle file has their mounting."""

    rate_Hz: float = knob(50.0, 1.0, 500.0, "rate of the output [Hz]")
    align_s: float = knob(1.0, 0.1, 60.0, "span over which tilt and gyroscope offset are averaged at the start [s]")
    align_patience_s: float = knob(6.0, 0.0, 600.0, "time for which alignment waits for rest [s]")
    still_dps: float = knob(0.5, 0.01, 90.0, "standard deviation of the offset from which on it rests [deg/s]")
    resumed_dps: float = knob(0.2, 0.001, 90.0, "uncertainty of a known offset after a gap in the samples [deg/s]")
    longest_gap_s: float = knob(0.5, 0.01, 10.0, "gap in the IMU's samples after which alignment restarts [s]")
    lock_s: float = knob(0.5, 0.05, 10.0, "age of a DVL velocity up to which it counts as locked [s]")


DEFAULT_KNOBS = NavigatorKnobs()


class Navigator:
    """Attitude, rates, velocity, depth, altitude and position of the body origin of one vehicle.

    The position is by dead reckoning, and its uncertainty grows from where it was last known: see
    `PositionUncertainty`.

    `step` takes every reading of every sensor under the name the vehicle file gives it; kinds it has no use for are
    ignored. Measurements that could not be used (not finite, far off, too late, too tilted) are counted in `refused`;
    `refusals` counts, by sensor, impossible values.
    """

    def __init__(self, vehicle: Vehicle, knobs: NavigatorKnobs = DEFAULT_KNOBS) -> None:
        self._vehicle = vehicle
        self._knobs = knobs
        self._span_s = knobs.align_s / SPANS
        self._period_ns = round(NS_PER_S / knobs.rate_Hz)
        self._mounts = {name: SensorMount(mount) for name, mount in vehicle.sensors.items()}
        self._dvls = vehicle.measuring("velocity")
        looking = [*vehicle.measuring("range_ahead")[:1], *vehicle.measuring("range_aside")[:1]]
        self._looking = () if self._dvls else tuple(looking)
        """Sonars that show a velocity by the range to a wall: none beside a DVL."""
        level = {*vehicle.measuring("range_ahead"), *vehicle.measuring("range_aside"), *vehicle.measuring("range")}
        self._unused = frozenset((*vehicle.measuring("rates")[1:], *(level - set(self._looking))))
        """One inertial sensor paces the filters, the first of the file; ranges elsewhere than down are no altitude."""
        self._coarse = any(row_of(vehicle.sensors[name].device).coarse for name in vehicle.measuring("rates")[:1])
        self._has_sonar = any(name not in self._dvls for name in vehicle.measuring("altitude"))
        self._forces_N: tuple[float, ...] = ()
        self._thrust_model = ThrustModel(vehicle)
        self._pushed = False
        """Whether a thruster ever pushed: before, a vehicle rests square to the wall that its sonar looks at."""
        self.refused = 0
        self._position, self._heading_rad = (0.0, 0.0), 0.0
        self._reckoning = PositionUncertainty(knobs)
        self._reckoned = EARLIEST
        self._offset = self._unknown = Offset((0.0, 0.0, 0.0), 0.5 * math.radians(knobs.offset_dps))
        self.refusals = Refusals()
        self._begin(Stamp(0))
        self._imu = self._changed = self._differed = EARLIEST
        self._sample = ZERO6
        self._disordered = 0

    def _begin(self, stamp: Stamp) -> None:
        """Restart: at the first sample, or after a long gap."""
        self._aiding = aiding = Aiding(self._vehicle, self._knobs)
        self._attitude, self._heading = aiding.attitude, aiding.heading
        self._vertical, self._horizontal = aiding.vertical, aiding.horizontal
        aiding.forces_N = self._forces_N
        half_beam_rad, knobs = 0.5 * math.radians(self._knobs.sonar_beam_deg), self._knobs
        by_wall = wall_knobs(knobs, knobs.offset_mps2, knobs.offset_walk)
        self._seen: dict[str, Stamp] = {}
        """When each wall was last seen."""
        self._walls = {name: WallSonar(self._mounts[name], by_wall, half_beam_rad) for name in self._looking}
        self._waiting: deque[tuple[Stamp, Reading, str]] = deque(maxlen=MOST_WAITING)
        self._received: dict[str, Stamp] = {}
        self._ahead: dict[str, tuple[Stamp, int]] = {}
        """Inertial sample after which each sensor was heard last, and how often in a row it was ahead of one."""
        self._locked = self._depth = self._altitude = EARLIEST
        self._echo = stamp if self._has_sonar else EARLIEST
        self._rate_radps: Vec3 = (0.0, 0.0, 0.0)
        self._aligned = False
        self._spans: deque[Span] = deque(maxlen=SPANS)
        self._imu = self._began = self._since = stamp
        self._due = after(stamp, self._span_s)
        self._clear_sums()

    def _clear_sums(self) -> None:
        self._turned_x = self._turned_y = self._turned_z = 0.0
        self._pushed_x = self._pushed_y = self._pushed_z = 0.0

    # ---- what comes in

    def thrust(self, forces_N: Sequence[float]) -> None:
        """Tell what each thruster does: their currents disturb the compass."""
        self._forces_N = self._aiding.forces_N = tuple(forces_N)
        self._pushed = self._pushed or any(forces_N)

    def confirm_position(self) -> None:
        """Take the present position as known: its uncertainty restarts."""
        self._reckoning.known()

    def set_gyroscope_offset(self, offset: Offset) -> None:
        """Begin with what an earlier navigator knew of the same gyroscope: the vehicle need not rest then."""
        self._offset = offset

    @property
    def gyroscope_offset(self) -> Offset | None:
        """State that survives a gap or a restart; None while nothing is known."""
        sigma = max(self._attitude.bias_sigma_radps, self._heading.bias_sigma_radps)
        if not self._aligned or sigma >= self._unknown.sigma_radps:
            return None
        return Offset(self._attitude.bias_radps, math.hypot(sigma, math.radians(self._knobs.resumed_dps)))

    def step(self, stamped: Stamped[Reading], source: str) -> Stamped[Navigation] | None:
        """Take one reading; a Navigation comes back whenever an IMU sample completes a tick."""
        reading = stamped.reading
        if source in self._unused:
            return None
        why = why_impossible(stamped)
        if why:
            self.refused += 1
            self.refusals.add(source, why)
            return None
        if isinstance(reading, Inertial):
            return self._inertial(stamped.stamp, reading, source)
        if not isinstance(reading, AIDS):
            return None
        if self._imu != EARLIEST and (why := self._of_another_clock(stamped, source)):
            self.refused += 1
            self.refusals.add(source, why)
        elif self._aligned or not isinstance(reading, BottomVelocity):
            self._waiting.append((stamped.stamp, reading, source))
        return None

    def _of_another_clock(self, stamped: Stamped[Reading], source: str) -> Refusal:
        """Return why a stamp does not fit those of the inertial samples (`CLOCK`), or nothing."""
        lead_s = (stamped.stamp - self._imu) / NS_PER_S
        heard, times = self._ahead.get(source, (EARLIEST, 0))
        if heard != self._imu:  # what was fetched together waited for the inertial samples that come with it
            times = times + 1 if lead_s > AHEAD_S else 0
            self._ahead[source] = self._imu, times
        latest_s = AHEAD_S if times >= AHEAD_TIMES else OTHER_CLOCK_S
        oldest_s = self._knobs.memory_s if isinstance(stamped.reading, BottomVelocity) else OTHER_CLOCK_S
        if -oldest_s <= lead_s <= latest_s:
            return NOTHING
        side, wanted_s = ("after", latest_s) if lead_s > 0.0 else ("before", oldest_s)
        cause = "another clock, or no inertial samples" if lead_s > 0.0 else "another clock, or it came late"
        found = f"found a stamp {abs(lead_s):.3g} s {side} the inertial sensor's, wanted within {wanted_s:g} s"
        return Refusal(Reason.CLOCK, f"{found}; {cause}: synchronize the clock of the sensor with the computer's")

    def _may_repeat(self, stamp: Stamp) -> bool:
        """Whether a sensor of coarse steps, in whatever axes, can have repeated its sample since it last differed.

        At rest for good; in a steady turn about the vertical, which changes nothing that it measures, for a while; in
        any other turn only until gravity has turned by some of its steps.
        """
        fx, fy, fz, p, q, r = self._sample
        offset_radps = math.hypot(*self._attitude.bias_radps)
        if max(abs(p), abs(q), abs(r)) < AT_REST_radps + offset_radps:
            return True
        repeated_s = (stamp - self._differed) / NS_PER_S
        across = math.hypot(q * fz - r * fy, r * fx - p * fz, p * fy - q * fx) / max(1.0, math.hypot(fx, fy, fz))
        return repeated_s <= STEADY_TURN_S and (across - offset_radps) * repeated_s <= STEPS_rad

    def _inertial(self, stamp: Stamp, reading: Inertial, source: str) -> Stamped[Navigation] | None:
        """Add one sample to the sums of the tick; a Navigation comes back when it completes one.

        Trapezoids of rates and of specific forces, in the axes of the sensor: they are turned into the body once per
        tick.
        """
        dt = (stamp - self._imu) / NS_PER_S
        fx, fy, fz = reading.specific_force_mps2
        p, q, r = reading.rate_radps
        if not dt > 0.0:
            self._out_of_order(stamp, dt, source)
            return None
        self._disordered = 0
        ex, ey, ez, o, n, m = before = self._sample
        self._sample = (fx, fy, fz, p, q, r)
        if self._sample != before:
            self._changed = self._differed = stamp
        elif self._coarse and self._may_repeat(stamp):
            self._changed = stamp
        if dt > self._knobs.longest_gap_s:
            self._restart(stamp)
            return None
        self._imu = self._received[source] = stamp
        # Samples are instants: without the one before, the angle would be half a period ahead of the rate.
        half = 0.5 * dt
        self._turned_x += half * (o + p)
        self._turned_y += half * (n + q)
        self._turned_z += half * (m + r)
        self._pushed_x += half * (ex + fx)
        self._pushed_y += half * (ey + fy)
        self._pushed_z += half * (ez + fz)
        if stamp < self._due:
            return None
        at = self._mounts.get(source, NOWHERE)
        if not self._complete(stamp, at, source):
            return None
        return Stamped(stamp, self._navigation(stamp, at.body(reading.rate_radps)))

    def _out_of_order(self, stamp: Stamp, dt: float, source: str) -> None:
        """Refuse a sample that is not later than the last; after many in a row the clock was set back, so restart."""
        self.refused += 1
        found = f"found a stamp {-dt:.3g} s before the last one, wanted a later one"
        self.refusals.add(source, Refusal(Reason.OUT_OF_ORDER, found))
        self._disordered += 1
        if self._disordered >= STEPPED_BACK and dt < 0.0:
            self._disordered = 0
            self._restart(stamp)

    def _restart(self, stamp: Stamp) -> None:
        """Begin anew. The gyroscope is the same and may not rest when it is back; the place is near."""
        self._heading_rad = self._attitude.heading_rad
        self._offset = self.gyroscope_offset or self._offset
        self._begin(stamp)

    # ---- what happens at a tick

    def _complete(self, stamp: Stamp, at: SensorMount, source: str) -> bool:
        """End a tick: the sums become angle and mean specific force, the filters predict, what waits is fused.

        False during alignment.
        """
        dt = (stamp - self._since) / NS_PER_S
        turned = at.body((self._turned_x, self._turned_y, self._turned_z))
        force = at.body((self._pushed_x / dt, self._pushed_y / dt, self._pushed_z / dt))
        self._clear_sums()
        self._since = stamp
        if self._aligned:
            self._predict(turned, force, dt, at)
        elif not self._align(force, (turned[0] / dt, turned[1] / dt, turned[2] / dt), stamp, source):
            self._due = after(stamp, self._span_s)
            return False
        # Ticks keep to their grid, so that the rate is right although samples do not fall on it.
        self._due = max(Stamp(self._due + self._period_ns), Stamp(stamp + self._period_ns // 2))
        # The IMU's samples come in batches: what was measured after this tick is left for the next one.
        waiting, self._waiting = self._waiting, deque(maxlen=MOST_WAITING)
        for one in waiting:
            valid, reading, source = one
            if _end(valid, reading) > stamp:
                self._waiting.append(one)
            elif self._fuse(valid, reading, source):
                self._received[source] = max(valid, self._received.get(source, valid))
        return True

    def _align(self, force: Vec3, rate: Vec3, stamp: Stamp, source: str) -> bool:
        """Begin when it rests, when the offset is known from before, or when patience is over, with an honest sigma.

        Not where the force is not that of gravity: what such a state would be made of is in other units.
        """
        spans, knobs = self._spans, self._knobs
        spans.append((rate, force))
        if len(spans) < SPANS:
            return False
        shown = offset_at_rest(spans, self._span_s)
        resting = shown.sigma_radps <= math.radians(knobs.still_dps)
        known = self._offset is not self._unknown
        if not (resting or known) and stamp < after(self._began, knobs.align_patience_s):
            return False
        size = math.hypot(*mean(force for _, force in spans))
        low, high = GRAVITY_BOUNDS_mps2
        if not low <= size <= high:
            what = "mean acceleration with gravity [m/s^2]"
            self.refusals.add(source, refused(Reason.IMPOSSIBLE, what=what, found=size, low=low, high=high, unit=""))
            return False
        offset = self._offset.combined(shown)
        # Swinging, gravity is where it was last, not where it was on the average.
        gravity, span_s = (mean(force for _, force in spans), knobs.align_s) if resting else (force, self._span_s)
        self._attitude.align(gravity, span_s, self._heading_rad)
        self._attitude.set_bias(offset.rate_radps, offset.sigma_radps)
        self._heading.widen_bias(offset.sigma_radps)
        self._aligned = True
        return True

    def _predict(self, turned: Vec3, force: Vec3, dt: float, at: SensorMount) -> None:
        """Carry attitude, heading, depth, velocities and place over a tick of `dt` [s].

        `turned` [rad] and the specific `force` f [m/s^2] of the tick are in body axes. In this order, since each needs
        the one before:

        - attitude: the angle less the offset of the gyroscope turns R, and f levels it (`AttitudeFilter`);
        - vertical: d . f + g is the acceleration downward; f is a mean over the tick, so d is that of its middle;
        - horizontal: u' and v' of f + g d - omega x v, with the heave of the vertical filter; without it where no depth
          shows it or the vehicle lies on its side;
        - scale of the DVL, and walls: the change of velocity in north and east, with which both compare what they see;
        - place: R (u, v, w) over the tick, where the velocity is known.
        """
        attitude, horizontal = self._attitude, self._horizontal
        bp, bq, br = attitude.bias_radps
        angle = (turned[0] - bp * dt, turned[1] - bq * dt, turned[2] - br * dt)
        p, q, r = rate = (angle[0] / dt, angle[1] / dt, angle[2] / dt)
        if at.away:
            force = self._at_origin(force, rate, dt, at.lever_m)
        north_was, east_was, before = attitude.rotation
        attitude.turn(angle, dt)
        self._heading.predict(dt)
        attitude.level(force, dt)
        north, east, now = attitude.rotation
        # A mean over the tick belongs to the attitude in its middle.
        dx, dy, dz = 0.5 * (before[0] + now[0]), 0.5 * (before[1] + now[1]), 0.5 * (before[2] + now[2])
        self._vertical.predict(force[0] * dx + force[1] * dy + force[2] * dz + GRAVITY_mps2, round(dt, 4))
        u, v = horizontal.u_mps, horizontal.v_mps
        w = self._heave(now, u, v) if self._vertical.has_depth and now[2] > LEAST_UPRIGHT else 0.0
        acceleration = (force[0] + GRAVITY_mps2 * dx - q * w + r * v, force[1] + GRAVITY_mps2 * dy - r * u + p * w)
        now_s = (self._imu - self._began) / NS_PER_S
        horizontal.predict(acceleration, angle, now_s, dt)
        fx, fy, fz = force
        half = 0.5 * dt
        change = complex(
            half * ((north_was[0] + north[0]) * fx + (north_was[1] + north[1]) * fy + (north_was[2] + north[2]) * fz),
            half * ((east_was[0] + east[0]) * fx + (east_was[1] + east[1]) * fy + (east_was[2] + east[2]) * fz),
        )
        self._aiding.gain.accelerated(change, r, now_s)
        self._witness(change, (u, v, w), rate, now_s, dt)
        for wall in self._walls.values():
            wall.predict(change / dt, attitude.rotation, dt)
            self._position = wall.placed(self._position)
        self._rate_radps = rate
        self._aiding.yaw_rate_radps = r
        if horizontal.known:
            (a, b, c), (d, e, f), _ = attitude.rotation
            self._reckon(dt * (a * u + b * v + c * w), dt * (d * u + e * v + f * w), dt)

    def _witness(self, change_mps: complex, velocity_mps: Vec3, rate: Vec3, now_s: float, dt: float) -> None:
        """Tell what accelerometer (north + i east) and thrusters make of a tick, against which a DVL is held."""
        expected_mps2 = self._thrust_model.step(self._forces_N, velocity_mps, rate, dt)
        ahead, down = self._attitude.ahead, self._attitude.rotation[2]
        if expected_mps2 is None or not ahead:
            self._aiding.hung.forget()
            return
        turned = dt * sum(axis * turn for axis, turn in zip(down, rate, strict=True))
        self._aiding.hung.changed(change_mps * ahead.conjugate(), dt * expected_mps2, turned, now_s)

    def _reckon(self, north_m: float, east_m: float, dt: float) -> None:
        """Count one step of the way, and how far it may be off.

        What is measured adds as independent errors, where nothing measures as one that stays (`PositionUncertainty`).
        """
        north, east = self._position
        self._position = self._aiding.place_m = (north + north_m, east + east_m)
        self._reckoning.move(self._attitude.heading_rad, north_m, east_m, dt)
        still_s = (self._imu - self._reckoned) / NS_PER_S - dt
        if self._reckoned != EARLIEST and still_s > dt:
            # The filters restarted; the velocity meanwhile is unknown.
            self._reckoning.unmeasured(self._vehicle.limits.speed_mps, still_s)
        elif not self._locked_at(self._imu):
            self._reckoning.unmeasured(self._horizontal.sigma_mps, dt)
        self._reckoned = self._imu

    def _at_origin(self, force: Vec3, rate: Vec3, dt: float, lever_m: Vec3) -> Vec3:
        """Specific force at the body origin: at the lever l it is more by omega' x l + omega x (omega x l).

        The derivative of the rates is their difference over the tick.
        """
        was = self._rate_radps
        turning = ((rate[0] - was[0]) / dt, (rate[1] - was[1]) / dt, (rate[2] - was[2]) / dt)
        tangential, centripetal = cross(turning, lever_m), cross(rate, cross(rate, lever_m))
        x, y, z = (f - t - c for f, t, c in zip(force, tangential, centripetal, strict=True))
        return (x, y, z)

    def _fuse(self, valid: Stamp, reading: Reading, source: str) -> bool:
        """Let the filters learn from one measurement; False when it was of no use."""
        at, aiding = self._mounts.get(source, NOWHERE), self._aiding
        delay_s = (self._imu - valid) / NS_PER_S
        match reading:
            case BottomVelocity(velocity_mps=None):
                return False
            case BottomVelocity():
                used = aiding.bottom_velocity(reading, at, (valid - self._began) / NS_PER_S, source)
                if used:
                    self._locked = max(self._locked, valid)
                    self._reckoning.measured(reading.sigma_mps, max(reading.interval_s, SHORTEST_SPAN_S))
            case Pressure():
                used = aiding.pressure(reading, at, delay_s, source)
                aiding.compare_floor(reading, (valid - self._began) / NS_PER_S)
                self._depth = max(self._depth, valid) if used else self._depth
            case Echo() if source in self._dvls:  # as a Tracker 650 reports its altitude
                self._dvl_altitude(reading.range_m, valid, at)
                return False
            case Echo():
                used = self._range(reading, at, valid, source)
            case Magnetic():
                return aiding.magnetic(reading, at, delay_s)
            case BottomTrack():
                aiding.dvl_heading(reading, delay_s)
                if reading.locked and reading.altitude_m is not None:
                    self._dvl_altitude(reading.altitude_m, valid, at)
                return False
            case _:
                return False
        self.refused += not used
        return used

    def _range(self, reading: Echo, at: SensorMount, valid: Stamp, source: str) -> bool:
        """Fuse a range to the floor or to a wall; walls are told apart by the heading, so that must be known."""
        wall, delay_s, knobs = self._walls.get(source), (self._imu - valid) / NS_PER_S, self._knobs
        if wall is None:
            used = self._aiding.echo(reading, at, delay_s)
            self._echo = max(self._echo, valid) if used else self._echo
            self._altitude = max(self._altitude, valid) if used else self._altitude
            return used
        waits = not self._heading.known and knobs.heading_from != "none"
        if waits or not reading.confidence >= knobs.sonar_confidence or not reading.range_m > 0.0:
            return False
        if self._forces_N and not self._pushed:
            wall.face(self._attitude.rotation)
        used = wall.echo(reading.range_m, knobs.range_sigma_m(reading.range_m), self._attitude.rotation, delay_s)
        self._seen[source] = max(valid, self._seen.get(source, valid)) if used else self._seen.get(source, EARLIEST)
        return used

    def _dvl_altitude(self, altitude_m: float, valid: Stamp, at: SensorMount) -> None:
        """Fuse the altitude of a DVL while no sonar gives one."""
        if (valid - self._echo) / NS_PER_S <= self._knobs.dvl_altitude_after_s:
            return
        if self._aiding.dvl_altitude(altitude_m, at, (self._imu - valid) / NS_PER_S):
            self._altitude = max(self._altitude, valid)

    # ---- what goes out

    def _heave(self, down: Vec3, u_mps: float, v_mps: float) -> float:
        """Heave velocity w in body axes: the downward rate is d . (u, v, w), solved for w; dz must not be near zero."""
        return (self._vertical.rate_mps - down[0] * u_mps - down[1] * v_mps) / down[2]

    def _locked_at(self, stamp: Stamp) -> bool:
        return (stamp - self._locked) / NS_PER_S < self._knobs.lock_s

    def _along(self, stamp: Stamp) -> tuple[list[float], list[float]]:
        """Velocities along x and y, and their deviations [m/s]; NaN where nothing has measured one."""
        horizontal = self._horizontal
        if horizontal.known:
            return [horizontal.u_mps, horizontal.v_mps], [horizontal.sigma_mps] * 2
        velocities, sigmas = [NAN, NAN], [NAN, NAN]
        fresh = after(stamp, -self._knobs.lock_s)
        for name, wall in self._walls.items():
            if self._seen.get(name, EARLIEST) > fresh:
                velocities[wall.axis], sigmas[wall.axis] = wall.velocity_mps(), wall.sigma_mps()
        return velocities, sigmas

    def _navigation(self, stamp: Stamp, rate: Vec3) -> Navigation:
        """State at a stamp, with its deviations; rates are those of the sample, less the offset.

        w = (down rate - dx u - dy v) / dz, so its variance is that of the down rate and of u and v by their factors; a
        velocity that nothing measures may be as large as the vehicle is fast.
        """
        attitude, vertical, horizontal = self._attitude, self._vertical, self._horizontal
        bp, bq, br = attitude.bias_radps
        down = attitude.rotation[2]
        w = heave_sigma = NAN
        (u, v), (u_sigma, v_sigma) = self._along(stamp)
        if down[2] > LEAST_UPRIGHT and vertical.has_depth:
            # Where nothing measures it, rest is the best guess: the accelerometer alone would integrate its offset.
            w = self._heave(down, 0.0 if math.isnan(u) else u, 0.0 if math.isnan(v) else v)
            most_mps = self._vehicle.limits.speed_mps
            along = down[0] * (most_mps if math.isnan(u) else u_sigma)
            aside = down[1] * (most_mps if math.isnan(v) else v_sigma)
            heave_sigma = math.sqrt(vertical.rate_variance + along * along + aside * aside) / down[2]
        return Navigation(
            attitude_rad=attitude.euler_rad,
            rate_radps=(rate[0] - bp, rate[1] - bq, rate[2] - br),
            velocity_mps=(u, v, w),
            depth_m=vertical.depth_m,
            altitude_m=vertical.altitude_m,
            position_m=self._position,
            dvl_locked=self._locked_at(stamp),
            ages_s={source: (stamp - received) / NS_PER_S for source, received in self._received.items()},
            velocity_sigma_mps=(u_sigma, v_sigma, heave_sigma),
            position_sigma_m=self._reckoning.sigma_m if horizontal.known else NAN,
            depth_age_s=_age_s(self._depth, stamp),
            altitude_age_s=_age_s(self._altitude, stamp),
            consistency=Consistency(
                self._began,
                attitude.tilt_sigma_rad,
                attitude.gravity_off_rad,
                vertical.refused_depths,
                horizontal.refused,
                self._aiding.sunk_off_m,
                (stamp - self._changed) / NS_PER_S,
                *self._aiding.gain.gain,
                self._aiding.drift.off_m,
            ),
        )


def _age_s(valid: Stamp, now: Stamp) -> float:
    """Age of what was valid at a stamp; infinite where nothing was ever used."""
    return math.inf if valid == EARLIEST else (now - valid) / NS_PER_S


def _end(valid: Stamp, reading: Reading) -> Stamp:
    """Last instant that a measurement depends on."""
    return after(valid, 0.5 * reading.interval_s) if isinstance(reading, BottomVelocity) else valid


AIDS = (BottomVelocity, Pressure, Echo, Magnetic, BottomTrack)
