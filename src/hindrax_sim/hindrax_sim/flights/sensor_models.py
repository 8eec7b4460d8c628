"""The sensors at reading level: truth plus noise, rounding, rate and latency, without bytes. For speed.

Biases and noise are drawn from the seed and the name of the sensor, so one sensor's draws never shift another's.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from hindrax_core import readings
from hindrax_core.events import NS_PER_S, Stamp, Stamped, to_s
from hindrax_core.readings import Reading, Vec3
from hindrax_core.vehicle import Mount
from hindrax_sim.physics.normal_draws import NormalDraws
from hindrax_sim.world import World

WATER_C = 24.0


@dataclass(frozen=True, slots=True)
class Noise:
    """Imperfections of the sensors; standard deviations unless stated otherwise."""

    # ICM-20948 (TDK DS-000189 table 1 and 2): noise density times the noise bandwidth of the 51 Hz filter.
    gyro_radps: float = math.radians(0.015) * math.sqrt(1.57 * 51.2)
    gyro_bias_radps: float = math.radians(2.5)
    """As it comes; table 1 gives 5 dps, taken for two standard deviations. The navigator finds it."""
    accelerometer_mps2: float = 230e-6 * 9.80665 * math.sqrt(1.57 * 50.4)
    accelerometer_bias_mps2: float = 0.003 * 9.80665
    magnetometer_T: float = 0.3e-6
    hard_iron_T: float = 0.5e-6
    pressure_Pa: float = 20.0  # MS5837-30BA at its finest: 0.2 mbar
    echo_share: float = 0.005  # Ping: 0.5 % of range
    dvl_mps: float = 0.01
    dvl_gain: float = 1.0
    """True factor on the DVL's velocity."""
    dvl_heading_rad: float = math.radians(1.0)


class SensorModel:
    """A sensor of the vehicle file at its mount, with a fixed rate, and a latency after what a sample depends on."""

    rate_Hz = 20.0
    latency_s = 0.0
    part = ""
    """Of a sensor with several: what the draws of this one are told apart by."""

    def __init__(self, world: World, source: str, mount: Mount, noise: Noise, seed: int) -> None:
        self.source = source
        self.period_ns = round(NS_PER_S / self.rate_Hz)
        self.latency_ns = round(NS_PER_S * self.latency_s)
        self._at, self._noise = world.mounting(mount), noise
        draws = NormalDraws(source + self.part, seed)
        self._normal, self._three = draws.normal, draws.three
        self._begin(world)

    def _begin(self, world: World) -> None:
        """Draw biases, and remember where the world is."""

    def sample(self, world: World) -> Sequence[Stamped[Reading]]:
        """Readings measured up to now."""
        reading = self._read(world)
        return () if reading is None else (Stamped(world.stamp, reading),)

    def _read(self, world: World) -> Reading | None:
        raise NotImplementedError

    def _counted(self, true: Vec3, bias: Vec3, sigma: float, step: float) -> Vec3:
        """What is true with bias and noise, in whole steps."""
        normal = self._normal
        x, y, z = (round((t + b + sigma * normal()) / step) * step for t, b in zip(true, bias, strict=True))
        return (x, y, z)


class ImuSensor(SensorModel):
    """Specific force and rate, 500 deg/s and 4 g full scale; fetched from the FIFO about fifty times a second."""

    rate_Hz = 225.0
    latency_s = 0.003
    RATE_STEP = math.radians(1.0 / 65.5)
    FORCE_STEP = 9.80665 / 8192.0
    FETCH_ns = round(NS_PER_S / 50.0)

    def _begin(self, world: World) -> None:
        self._rate_bias = self._three(self._noise.gyro_bias_radps)
        self._force_bias = self._three(self._noise.accelerometer_bias_mps2)
        self._fifo: list[Stamped[Reading]] = []
        self._fetch = Stamp(world.stamp + self.FETCH_ns)

    def sample(self, world: World) -> Sequence[Stamped[Reading]]:
        """Add one sample to the FIFO; returns all samples when it is read."""
        force, rate = world.inertial(self._at)
        force = self._counted(force, self._force_bias, self._noise.accelerometer_mps2, self.FORCE_STEP)
        rate = self._counted(rate, self._rate_bias, self._noise.gyro_radps, self.RATE_STEP)
        self._fifo.append(Stamped(world.stamp, readings.Inertial(force, rate, WATER_C)))
        if world.stamp < self._fetch:
            return ()
        self._fetch = Stamp(self._fetch + self.FETCH_ns)
        fetched, self._fifo = self._fifo, []
        return fetched


class MagnetometerSensor(SensorModel):
    """The magnetometer in the same package; its own rate."""

    rate_Hz = 25.0
    latency_s = 0.009
    part = " compass"
    STEP_T = 0.15e-6

    def _begin(self, _world: World) -> None:
        self._hard_iron = self._three(self._noise.hard_iron_T)

    def _read(self, world: World) -> Reading:
        true_T = world.magnetic_T(self._at)
        return readings.Magnetic(self._counted(true_T, self._hard_iron, self._noise.magnetometer_T, self.STEP_T))


class PressureSensor(SensorModel):
    """Absolute pressure, available after the conversion of its temperature."""

    rate_Hz = 50.0
    latency_s = 0.005
    STEP_Pa = 10.0

    def _read(self, world: World) -> Reading:
        value = world.pressure_Pa(self._at) + self._noise.pressure_Pa * self._normal()
        return readings.Pressure(round(value / self.STEP_Pa) * self.STEP_Pa, WATER_C)


class SonarSensor(SensorModel):
    """Distance to the nearest point of the floor within the beam; nothing outside the floor."""

    latency_s = 0.023
    HALF_BEAM_rad = math.radians(12.5)
    STEP_m = 0.001

    def _read(self, world: World) -> Reading | None:
        found = world.range_m(self._at, self.HALF_BEAM_rad)
        if found is None or found <= 0.0:
            return None
        found += self._noise.echo_share * found * self._normal()
        return readings.Echo(max(0.0, round(found / self.STEP_m) * self.STEP_m), 0.95)


class DvlSensor(SensorModel):
    """Mean velocity over each interval, every delta rounded to 1 mm on its own; lock, attitude and altitude."""

    latency_s = 0.008
    STEP_m = 0.001
    MOST_TILT_rad = math.radians(45.0)
    LEAST_RANGE_m = 0.1

    def _begin(self, world: World) -> None:
        self._was = world.travel(self._at)[1]
        self._stamp = world.stamp
        self._turn = 0

    def sample(self, world: World) -> Sequence[Stamped[Reading]]:
        """Velocity over the interval that ends now; every second time the bottom track too."""
        now, was, before = world.travel(self._at)[1], self._was, self._stamp
        self._was, self._stamp = now, world.stamp
        span_s = to_s(world.stamp - before)
        if span_s <= 0.0:
            return ()
        range_m = world.range_m(self._at)
        locked = (
            not world.dvl_silenced
            and range_m is not None
            and range_m > self.LEAST_RANGE_m
            and world.tilt_rad(self._at) < self.MOST_TILT_rad
        )
        middle = Stamp((world.stamp + before) // 2)
        velocity = Stamped(middle, self._velocity(now, was, span_s, locked, world.stamp // 1000))
        self._turn ^= 1
        if self._turn:
            return (velocity,)
        return (velocity, Stamped(world.stamp, self._track(world, locked, range_m)))

    def _velocity(self, now: Vec3, was: Vec3, span_s: float, locked: bool, device_us: int) -> readings.BottomVelocity:
        if not locked:
            return readings.BottomVelocity(None, math.inf, 0.0, span_s, device_us)
        noise, step = self._noise, self.STEP_m
        errors = self._three(noise.dvl_mps * span_s)
        moved = ((noise.dvl_gain * (b - a) + e) for a, b, e in zip(was, now, errors, strict=True))
        u, v, w = (round(one / step) * step / span_s for one in moved)
        sigma = math.hypot(0.01, step / math.sqrt(12.0) / span_s)
        return readings.BottomVelocity((u, v, w), sigma, 1.0, span_s, device_us)

    def _track(self, world: World, locked: bool, range_m: float | None) -> readings.BottomTrack:
        roll, pitch, heading = world.attitude_rad
        heading += self._noise.dvl_heading_rad * self._normal()
        altitude = round(range_m, 2) if locked and range_m is not None else None
        return readings.BottomTrack(locked, roll, pitch, heading, altitude, (0.0, 0.0), (), "3333", 0)


class BatterySensor(SensorModel):
    """Supply voltage at the speed controllers, in steps of an INA226; its error is that of 16 bits, so none here."""

    rate_Hz = 10.0
    STEP_V = 1.25e-3

    def _read(self, world: World) -> Reading:
        return readings.Battery(round(world.plant.supply_V / self.STEP_V) * self.STEP_V, world.supply_A)


KINDS: dict[str, tuple[type[SensorModel], ...]] = {
    "icm20948": (ImuSensor, MagnetometerSensor),
    "ms5837": (PressureSensor,),
    "ping1d": (SonarSensor,),
    "dvl75": (DvlSensor,),
    "ina226": (BatterySensor,),
    "ads1115": (BatterySensor,),
}


def sensors(world: World, noise: Noise, seed: int) -> list[SensorModel]:
    """Models of all sensors of the vehicle file whose kind has one."""
    return [
        make(world, source, mount, noise, seed)
        for source, mount in world.vehicle.sensors.items()
        for make in KINDS.get(mount.device, ())
    ]
