"""The mock world: one vehicle in one pool, its time, and the truth that every sensor would see at its mount."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from hindrax_core.events import NS_PER_S, Stamp, seconds_between, stamp_from_s
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Quaternion, Vec3, Vec6
from hindrax_core.rotation import minus
from hindrax_core.signals import ZERO6
from hindrax_core.vehicle import WITHIN, Mount, Vehicle
from hindrax_sim.conditions.world_table import realize
from hindrax_sim.physics.geometry import euler, plus, quaternion, rotate, rotate_back, unit
from hindrax_sim.physics.normal_draws import NormalDraws
from hindrax_sim.physics.plant import LONGEST_STEP_S, Influence, Plant
from hindrax_sim.physics.pool import PoolWalls
from hindrax_sim.physics.thruster import thruster_A

GUST_PERIOD_S = 0.1
ARMS_m = 0.05
"""So much deeper than afloat, hands that hold a vehicle pull with twice what it weighs in the water."""
GRAZING_rad = math.radians(45.0)
"""Of a wall that a beam meets at more than this angle to its normal, no echo comes back."""
DRIFT_mps = 0.01
"""Of a pressure that drifts, as a depth."""
HELD_ns = stamp_from_s(0.2)
"""Where a vehicle that is held comes to rest so often, it rocks no more after a few seconds."""


@dataclass(frozen=True, slots=True)
class Conditions:
    """Conditions that vary between days at the pool; all random values come from the seed of the world."""

    thrust_noise: float = 0.02
    """Standard deviation of each thruster's force, as a share of it, drawn ten times a second."""
    heading_rad: float = 0.0
    """Compass heading of the pool's length."""
    field_T: Vec3 = (17.5e-6, 0.0, -13.8e-6)
    """Magnetic field: north, east, down (Sao Paulo, to the nearest half microtesla)."""
    motor_field_T_per_A: float = 0.4e-6
    """Field of a thruster's current at the magnetometer, in a direction of its own."""
    sizes: Mapping[str, float] = field(default_factory=dict)
    """Effects outside the model: conditions of `conditions.world_table` by name, each with its size."""

    @property
    def thrust_density_s(self) -> float:
        """Density of the thrust's noise at low frequencies, per square of the thrust."""
        return self.thrust_noise**2 * GUST_PERIOD_S


@dataclass(frozen=True, slots=True)
class Mounting:
    """A prepared mount: lever from the center of mass in body axes, rotation sensor to body (None: none)."""

    lever_m: Vec3
    turn: Quaternion | None

    def into_sensor(self, vector: Vec3) -> Vec3:
        """Turn a body vector into the sensor's axes."""
        return vector if self.turn is None else rotate_back(self.turn, vector)

    def into_body(self, vector: Vec3) -> Vec3:
        """Turn a sensor vector into body axes."""
        return vector if self.turn is None else rotate(self.turn, vector)


def carried(vehicle: Vehicle) -> tuple[Influence, ...]:
    """Hands that hold a vehicle that sinks where it would be afloat, until a thruster turns; none for one that floats.

    Nobody lets go of such a vehicle and prepares the flight while it lies on the floor, where a sonar is too near.

    Parameters
    ----------
    vehicle
        As it is.

    Returns
    -------
    tuple[Influence, ...]
        For the plant: a force at the center of mass, upward.
    """
    if vehicle.net_buoyancy_N >= 0.0:
        return ()
    afloat_z, down = 0.5 * vehicle.envelope_m[2] + vehicle.center_of_mass_m[2], (0.0, 0.0, 1.0)
    held = True

    def carry(plant: Plant, _dt: float) -> Vec6:
        nonlocal held
        held = held and not any(plant.targets_N)
        if not held:
            return ZERO6
        force_N = vehicle.net_buoyancy_N * (1.0 + max(0.0, plant.z - afloat_z) / ARMS_m)
        x, y, z = rotate_back(plant.quaternion, down)
        return (force_N * x, force_N * y, force_N * z, 0.0, 0.0, 0.0)

    return (carry,)


class World:
    """Vehicle, pool and time. `advance` brings it to a stamp exactly, so all truths of one stamp belong together."""

    def __init__(
        self, vehicle: Vehicle, seed: int = 0, conditions: Conditions | None = None, plant: type[Plant] = Plant
    ) -> None:
        self.conditions = conditions or Conditions()
        self.truth = realize(vehicle, self.conditions.sizes, seed)
        self.vehicle = vehicle = self.truth.vehicle
        """The true vehicle, which the vehicle file does not know."""
        self.plant = plant(vehicle, (*self.truth.influences, *carried(vehicle)), self.truth.thrust_losses)
        self.box = PoolWalls(vehicle)
        self.stamp = Stamp(0)
        self.dvl_silenced = False
        """Fault: the DVL finds no bottom."""
        self.supply_dead = False
        """Fault: the thrusters have no power, and a battery sensor sees it."""
        self.water_in_hull = False
        """Fault: the dry hull leaks."""
        self.pressure_drifts_since: Stamp | None = None
        """Fault: every pressure drifts since then."""
        self._draws = NormalDraws("world", seed)
        self._motor_fields = [unit(self._draws.three(1.0)) for _ in vehicle.thrusters]
        self._failed: dict[str, float] = {}
        self._next_gust = Stamp(0)
        self._disturb()
        self.float_at_the_surface()

    def float_at_the_surface(self) -> None:
        """Start pose: afloat in the middle of the pool, level, heading along its length."""
        vehicle = self.vehicle
        share = min(1.0, vehicle.mass_kg / (vehicle.volume_m3 * vehicle.water.density_kgpm3))
        immersion = (share - 0.5) * vehicle.envelope_m[2]
        ox, oy, oz = vehicle.center_of_mass_m
        self.plant.place((ox, oy, immersion + oz), (0.0, 0.0, 0.0))

    # ---- inputs

    def settle(self, stamp: Stamp) -> None:
        """Advance to a stamp with the vehicle held at its place and heading: it has stopped rocking when let go."""
        while self.stamp < stamp and self.conditions.sizes:
            self.advance(min(stamp, Stamp(self.stamp + HELD_ns)))
            roll, pitch, _ = euler(self.plant.quaternion)
            self.plant.place((0.0, 0.0, self.plant.z), (roll, pitch, 0.0))
        self.advance(stamp)

    def advance(self, stamp: Stamp) -> None:
        """Advance to a stamp; a past stamp does nothing."""
        while self._next_gust < stamp:
            self._integrate_until(self._next_gust)
            self._disturb()
        self._integrate_until(stamp)

    def _integrate_until(self, stamp: Stamp) -> None:
        left_s = (stamp - self.stamp) / NS_PER_S
        if left_s <= 0.0:
            return
        count = math.ceil(left_s / LONGEST_STEP_S)
        step, confine, plant, dt = self.plant.step, self.box.confine, self.plant, left_s / count
        for _ in range(count):
            step(dt)
            if plant.confined:
                confine(plant)
        self.stamp = stamp

    def _disturb(self) -> None:
        self._next_gust = Stamp(self._next_gust + stamp_from_s(GUST_PERIOD_S))
        noise, normal = self.conditions.thrust_noise, self._draws.normal
        gains = [self._failed.get(one.name, 1.0) * (1.0 + noise * normal()) for one in self.vehicle.thrusters]
        self.plant.scale_thrusters(gains)

    def drive(self, pulses_us: Sequence[float]) -> None:
        """Apply one pulse per thruster until the next call."""
        pulses = tuple(pulses_us)
        if pulses != self.plant.pulses_us:
            self.plant.drive(pulses)

    def fail_thruster(self, name: str, gain: float = 0.0) -> None:
        """Fault: this thruster produces only a share of its thrust from now on; ValueError for an unknown one."""
        known = [one.name for one in self.vehicle.thrusters]
        if name not in known:
            raise ValueError(f"thruster {name!r}: unknown, wanted one of {', '.join(known)}")
        self._failed[name] = gain
        self.plant.scale_thrusters([self._failed.get(one, 1.0) for one in known])

    # ---- the truth at a mount

    def mounting(self, mount: Mount) -> Mounting:
        """Prepare a mount of this vehicle."""
        roll, pitch, yaw = map(math.radians, mount.rotation_deg)
        turn = quaternion((roll, pitch, yaw)) if any(mount.rotation_deg) else None
        return Mounting(minus(mount.position_m, self.vehicle.center_of_mass_m), turn)

    @property
    def attitude_rad(self) -> Vec3:
        """Roll, pitch and compass heading (-pi to pi)."""
        roll, pitch, yaw = euler(self.plant.quaternion)
        return (roll, pitch, math.remainder(yaw + self.conditions.heading_rad, math.tau))

    @property
    def depth_m(self) -> float:
        """Depth of the body origin below the surface."""
        return self.point_m((0.0, 0.0, 0.0))[2] - rotate(self.plant.quaternion, self.vehicle.center_of_mass_m)[2]

    @property
    def supply_V(self) -> float:
        """Voltage at the thrusters, as a battery sensor sees it."""
        return 0.0 if self.supply_dead else self.plant.supply_V

    @property
    def supply_A(self) -> float:
        """Current that all thrusters draw."""
        return 0.0 if self.supply_dead else sum(map(thruster_A, self.plant.targets_N))

    def point_m(self, lever_m: Vec3) -> Vec3:
        """Position of a point of the vehicle in the pool [m]."""
        plant = self.plant
        return plus((plant.x, plant.y, plant.z), rotate(plant.quaternion, lever_m))

    def inertial(self, at: Mounting) -> tuple[Vec3, Vec3]:
        """Specific force [m/s^2] and rate [rad/s] in the sensor's axes, with the effect of rotation at its lever."""
        plant = self.plant
        p, q, r = plant.p, plant.q, plant.r
        w, x, y, z = plant.quaternion
        # The body-frame acceleration of the water cancels: current is uniform and steady.
        fx = plant.du + q * plant.w - r * plant.v - GRAVITY_mps2 * 2.0 * (x * z - w * y)
        fy = plant.dv + r * plant.u - p * plant.w - GRAVITY_mps2 * 2.0 * (y * z + w * x)
        fz = plant.dw + p * plant.v - q * plant.u - GRAVITY_mps2 * (1.0 - 2.0 * (x * x + y * y))
        lx, ly, lz = at.lever_m
        if lx or ly or lz:
            dp, dq, dr, along = plant.dp, plant.dq, plant.dr, p * lx + q * ly + r * lz
            square = p * p + q * q + r * r
            fx += dq * lz - dr * ly + p * along - square * lx
            fy += dr * lx - dp * lz + q * along - square * ly
            fz += dp * ly - dq * lx + r * along - square * lz
        return at.into_sensor((fx, fy, fz)), at.into_sensor((p, q, r))

    def magnetic_T(self, at: Mounting) -> Vec3:
        """Field of the earth and of the thrusters' currents in the sensor's axes."""
        conditions = self.conditions
        north, east, down = conditions.field_T
        cos, sin = math.cos(conditions.heading_rad), math.sin(conditions.heading_rad)
        own = (cos * north + sin * east, cos * east - sin * north, down)
        field_T = rotate_back(self.plant.quaternion, own)
        for force, along in zip(self.plant.targets_N, self._motor_fields, strict=True):
            field_T = plus(field_T, along, conditions.motor_field_T_per_A * thruster_A(force))
        return at.into_sensor(field_T)

    def pressure_Pa(self, at: Mounting) -> float:
        """Absolute pressure at the sensor; that of the air when it is out of the water."""
        water, since = self.vehicle.water, self.pressure_drifts_since
        drift_m = DRIFT_mps * seconds_between(since, self.stamp) if since is not None else 0.0
        seen_m = max(0.0, self.point_m(at.lever_m)[2]) + drift_m
        return water.surface_pressure_Pa + seen_m * water.density_kgpm3 * GRAVITY_mps2

    def velocity_mps(self, at: Mounting) -> Vec3:
        """Velocity over ground of the sensor in its own axes."""
        u, v, w = self.plant.velocity_over_ground
        p, q, r = self.plant.p, self.plant.q, self.plant.r
        lx, ly, lz = at.lever_m
        return at.into_sensor((u + q * lz - r * ly, v + r * lx - p * lz, w + p * ly - q * lx))

    def travel(self, at: Mounting) -> tuple[Vec3, Vec3]:
        """Angle turned and ground covered since the start, as a velocity sensor takes them: with its errors.

        Parameters
        ----------
        at
            Lever and axes of the sensor.

        Returns
        -------
        tuple[Vec3, Vec3]
            [rad] and [m], in the sensor's axes, summed step by step.
        """
        plant = self.plant
        travel = (plant.ax, plant.ay, plant.az), (plant.sx, plant.sy, plant.sz)
        for error in self.truth.travel_errors:
            travel = error(plant, travel)
        (ax, ay, az), (sx, sy, sz) = travel
        lx, ly, lz = at.lever_m
        ground = (sx + ay * lz - az * ly, sy + az * lx - ax * lz, sz + ax * ly - ay * lx)
        return at.into_sensor((ax, ay, az)), at.into_sensor(ground)

    def height_m(self, at: Mounting) -> float:
        """Vertical distance of the sensor above the floor."""
        return self.vehicle.pool.depth_m - self.point_m(at.lever_m)[2]

    def tilt_rad(self, at: Mounting) -> float:
        """Angle between the sensor's z axis and straight down."""
        along = rotate(self.plant.quaternion, at.into_body((0.0, 0.0, 1.0)))
        return math.acos(min(1.0, max(-1.0, along[2])))

    def range_m(self, at: Mounting, half_beam_rad: float = 0.0) -> float | None:
        """Distance to the floor along the sensor's z axis, or to its nearest point within a cone. Walls are not seen.

        Parameters
        ----------
        at
            Lever and axes of the sensor.
        half_beam_rad : [rad]
            Half the angle of the cone.

        Returns
        -------
        float | None
            [m]; None when the axis does not meet the floor.
        """
        slant = max(0.0, self.tilt_rad(at) - half_beam_rad)
        return self.height_m(at) / math.cos(slant) if slant < 1.4 else None

    def echo_m(self, at: Mounting, half_beam_rad: float = 0.0) -> float | None:
        """Distance that a sonar finds: to the floor where it is mounted to look down, else to what it looks at.

        That is the nearest of walls, floor and surface, each as in `range_m`.

        Parameters
        ----------
        at, half_beam_rad
            As of `range_m`.

        Returns
        -------
        float | None
            [m]; None when it meets nothing steeply enough.
        """
        if at.into_body((0.0, 0.0, 1.0))[2] > WITHIN:
            return self.range_m(at, half_beam_rad)
        pool, seen = self.vehicle.pool, []
        axis = rotate(self.plant.quaternion, at.into_body((0.0, 0.0, 1.0)))
        x, y, z = self.point_m(at.lever_m)
        ends = ((0.5 * pool.length_m, -0.5 * pool.length_m), (0.5 * pool.width_m, -0.5 * pool.width_m))
        for along, here, (far, near) in zip(axis, (x, y, z), (*ends, (pool.depth_m, 0.0)), strict=True):
            slant = max(0.0, math.acos(min(1.0, abs(along))) - half_beam_rad)
            if slant < GRAZING_rad:
                seen.append(((far - here) if along > 0.0 else (here - near)) / math.cos(slant))
        return min(seen, default=None)
