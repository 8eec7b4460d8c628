"""The sensors at reading level: truth plus noise, rounding, rate and latency, without bytes. For speed.

Biases and noise are drawn from the seed and the name of the sensor, so one sensor's draws never shift another's.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

from hindrax_core import readings
from hindrax_core.events import NS_PER_S, Stamp, Stamped, to_s
from hindrax_core.readings import Reading, Vec3
from hindrax_core.sensor_table import Capability, row_of
from hindrax_sim.physics.normal_draws import NormalDraws
from hindrax_sim.world import Mounting, World

WATER_C = 24.0
FETCH_ns = round(NS_PER_S / 50.0)
RATE_STEP_radps, FORCE_STEP_mps2, FIELD_STEP_T = math.radians(1.0 / 65.5), 9.80665 / 8192.0, 0.15e-6
PRESSURE_STEP_Pa, STEP_m, STEP_V = 10.0, 0.001, 1.25e-3
HALF_BEAM_rad, MOST_TILT_rad, LEAST_RANGE_m = math.radians(12.5), math.radians(45.0), 0.1


@dataclass(frozen=True, slots=True)
class SensorNoise:
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


Sample: TypeAlias = Callable[[], Sequence[Stamped[Reading]]]
Model: TypeAlias = Callable[[World, Mounting, SensorNoise, NormalDraws], Sample]


@dataclass(frozen=True, slots=True, eq=False)
class SensorModel:
    """A sensor of the vehicle file: `sample` gives what it measured up to now, to be asked every period.

    Its readings arrive a latency after the state of the sample.
    """

    source: str
    period_ns: int
    latency_ns: int
    sample: Sample


def _counted(true: Vec3, bias: Vec3, sigma: float, step: float, draws: NormalDraws) -> Vec3:
    """Truth with bias and noise, in whole steps."""
    (x, y, z), (x_bias, y_bias, z_bias), normal = true, bias, draws.normal
    return (
        round((x + x_bias + sigma * normal()) / step) * step,
        round((y + y_bias + sigma * normal()) / step) * step,
        round((z + z_bias + sigma * normal()) / step) * step,
    )


def _single(world: World, read: Callable[[], Reading | None]) -> Sample:
    """Sample of a sensor with one quantity at a time."""

    def sample() -> Sequence[Stamped[Reading]]:
        reading = read()
        return () if reading is None else (Stamped(world.stamp, reading),)

    return sample


def _imu(world: World, at: Mounting, noise: SensorNoise, draws: NormalDraws) -> Sample:
    """Specific force and rate, 500 deg/s and 4 g full scale; fetched from the FIFO about fifty times a second."""
    rate_bias, force_bias = draws.three(noise.gyro_bias_radps), draws.three(noise.accelerometer_bias_mps2)
    fifo: list[Stamped[Reading]] = []
    fetch = Stamp(world.stamp + FETCH_ns)

    def sample() -> Sequence[Stamped[Reading]]:
        nonlocal fifo, fetch
        force, rate = world.inertial(at)
        force = _counted(force, force_bias, noise.accelerometer_mps2, FORCE_STEP_mps2, draws)
        rate = _counted(rate, rate_bias, noise.gyro_radps, RATE_STEP_radps, draws)
        fifo.append(Stamped(world.stamp, readings.Inertial(force, rate, WATER_C)))
        if world.stamp < fetch:
            return ()
        fetch = Stamp(fetch + FETCH_ns)
        fetched, fifo = fifo, []
        return fetched

    return sample


def _magnetometer(world: World, at: Mounting, noise: SensorNoise, draws: NormalDraws) -> Sample:
    iron, sigma = draws.three(noise.hard_iron_T), noise.magnetometer_T
    return _single(world, lambda: readings.Magnetic(_counted(world.magnetic_T(at), iron, sigma, FIELD_STEP_T, draws)))


def _barometer(world: World, at: Mounting, noise: SensorNoise, draws: NormalDraws) -> Sample:
    """Absolute pressure, available after the conversion of its temperature."""

    def read() -> Reading:
        value = world.pressure_Pa(at) + noise.pressure_Pa * draws.normal()
        return readings.Pressure(round(value / PRESSURE_STEP_Pa) * PRESSURE_STEP_Pa, WATER_C)

    return _single(world, read)


def _sonar(world: World, at: Mounting, noise: SensorNoise, draws: NormalDraws) -> Sample:
    """Distance to the nearest point of the floor within the beam; nothing outside the floor."""

    def read() -> Reading | None:
        found = world.echo_m(at, HALF_BEAM_rad)
        if found is None or found <= 0.0:
            return None
        found += noise.echo_share * found * draws.normal()
        return readings.Echo(max(0.0, round(found / STEP_m) * STEP_m), 0.95)

    return _single(world, read)


def _battery(world: World, _at: Mounting, _noise: SensorNoise, _draws: NormalDraws) -> Sample:
    """Supply voltage at the speed controllers, in steps of an INA226; its error is that of 16 bits, so none here."""
    return _single(world, lambda: readings.Battery(round(world.supply_V / STEP_V) * STEP_V, world.supply_A))


def _dvl(world: World, at: Mounting, noise: SensorNoise, draws: NormalDraws) -> Sample:
    """Mean velocity over each interval, every delta rounded to 1 mm on its own; lock, attitude and altitude.

    Every second time the bottom track comes with the velocity over the interval that ends now.
    """
    was, began, turn = world.travel(at)[1], world.stamp, 0

    def sample() -> Sequence[Stamped[Reading]]:
        nonlocal was, began, turn
        now, before, start = world.travel(at)[1], was, began
        was, began = now, world.stamp
        span_s = to_s(world.stamp - start)
        range_m = world.range_m(at)
        in_range = not world.dvl_silenced and range_m is not None and range_m > LEAST_RANGE_m
        locked = in_range and world.tilt_rad(at) < MOST_TILT_rad
        velocity = Stamped(Stamp((world.stamp + start) // 2), over_ground(now, before, span_s, locked))
        turn ^= 1
        return (velocity,) if turn else (velocity, Stamped(world.stamp, track(locked, range_m)))

    def over_ground(now: Vec3, was: Vec3, span_s: float, locked: bool) -> Reading:
        device_us = world.stamp // 1000
        if not locked:
            return readings.BottomVelocity(None, math.inf, 0.0, span_s, device_us)
        errors = draws.three(noise.dvl_mps * span_s)
        moved = ((noise.dvl_gain * (b - a) + e) for a, b, e in zip(was, now, errors, strict=True))
        u, v, w = (round(one / STEP_m) * STEP_m / span_s for one in moved)
        sigma = math.hypot(0.01, STEP_m / math.sqrt(12.0) / span_s)
        return readings.BottomVelocity((u, v, w), sigma, 1.0, span_s, device_us)

    def track(locked: bool, range_m: float | None) -> Reading:
        roll, pitch, heading = world.attitude_rad
        heading += noise.dvl_heading_rad * draws.normal()
        altitude = round(range_m, 2) if locked and range_m is not None else None
        return readings.BottomTrack(locked, roll, pitch, heading, altitude, (0.0, 0.0), (), "3333", 0)

    return sample


MODELS: tuple[tuple[Capability, Model, float, float, str], ...] = (
    ("rates", _imu, 225.0, 0.003, ""),
    ("field", _magnetometer, 25.0, 0.009, " compass"),
    ("depth", _barometer, 50.0, 0.005, ""),
    ("range", _sonar, 20.0, 0.023, ""),
    ("velocity", _dvl, 20.0, 0.008, ""),
    ("supply", _battery, 10.0, 0.0, ""),
)
"""What a sensor measures, the model, rate [Hz], latency [s]; what separates the draws of a second model of one sensor.

Rates and latencies are those of ICM-20948, MS5837, Ping, DVL-75 and INA226: of a sensor, not of its kind.
"""


def sensors(world: World, noise: SensorNoise, seed: int) -> list[SensorModel]:
    """Make models of all that the sensors of the vehicle file measure, as far as there is one.

    Parameters
    ----------
    world
        That they sense, through the mounts of the true vehicle.
    noise
        Standard deviations.
    seed
        Of their draws, each with its own.

    Returns
    -------
    list[SensorModel]
        One for each quantity of each sensor.
    """
    return [
        SensorModel(
            *(source, round(NS_PER_S / rate_Hz), round(NS_PER_S * latency_s)),
            make(world, world.mounting(mount), noise, NormalDraws(source + part, seed)),
        )
        for source, mount in world.vehicle.sensors.items()
        for measured, make, rate_Hz, latency_s, part in MODELS
        if measured in row_of(mount.device).measures
    ]
