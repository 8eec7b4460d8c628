"""A vehicle on a motion in closed form, the sensors that watch it, and a navigator that hears them."""

import math
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TypeVar

from hindrax_control.navigation.navigator import Navigator, NavigatorKnobs
from hindrax_control.testing.motion import Motion, Way, rotate_back, vector
from hindrax_core.events import Stamped, stamp_from_s
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import BottomVelocity, Echo, Inertial, Magnetic, Pressure, Reading, Vec3
from hindrax_core.rotation import matrix
from hindrax_core.signals import Navigation
from hindrax_core.vehicle import Mount, Vehicle, load_vehicle

T = TypeVar("T")
VEHICLE = load_vehicle(Path(__file__).parents[2] / "hindrax_bringup/vehicles/hindrax.yaml")
CENTERED = replace(VEHICLE, sensors={name: Mount(name) for name in ("icm20948", "ms5837", "ping1d", "dvl75")})
MOUNTED = replace(
    VEHICLE,
    sensors={
        "icm20948": Mount("icm20948", position_m=(0.1, -0.05, 0.02), rotation_deg=(180.0, 0.0, 90.0)),
        "ms5837": Mount("ms5837", position_m=(-0.2, 0.1, 0.0)),
        "ping1d": Mount("ping1d", position_m=(-0.15, 0.0, 0.15)),
        "dvl75": Mount("dvl75", position_m=(0.2, 0.1, 0.15), rotation_deg=(0.0, 0.0, 45.0)),
    },
)
FLOOR_m = 1.8
FIELD_T = (17.5e-6, 0.0, -13.8e-6)
HOVER: Way = lambda _: (0.0, 0.0, 0.9)  # noqa: E731
STILL: Way = lambda _: (0.0, 0.0, 0.0)  # noqa: E731


def part(of: Callable[[T], Sequence[float]], axis: int) -> Callable[[T], float]:
    """Give one component of what a function gives."""
    return lambda one: of(one)[axis]


@dataclass
class Ride(Motion):
    """A motion, and the sensors that watch it."""

    position: Way = HOVER
    attitude: Way = STILL
    vehicle: Vehicle = CENTERED
    knobs: NavigatorKnobs = field(default_factory=NavigatorKnobs)
    gyro_bias: Vec3 = (0.0, 0.0, 0.0)
    force_bias: Vec3 = (0.0, 0.0, 0.0)
    noise: float = 0.0
    dvl_delay_s: float = 0.02
    dvl_from_s: float = 0.0
    dvl_until_s: float = 1e9
    sonar_until_s: float = 1e9
    deep: bool = True
    motors_T: Way = STILL

    def __post_init__(self) -> None:
        self.navigator = Navigator(self.vehicle, self.knobs)
        self.out: list[Stamped[Navigation]] = []
        self.random = random.Random(1)

    def inertial(self, t: float, mount: Mount) -> Inertial:
        force = self.specific_force(t, mount.position_m)
        turn = matrix(vector(math.radians(x) for x in mount.rotation_deg))
        return Inertial(
            vector(f + d for f, d in zip(rotate_back(turn, force), self.force_bias, strict=True)),
            vector(w + d for w, d in zip(rotate_back(turn, self.rates(t)), self.gyro_bias, strict=True)),
            20.0,
        )

    def tell(self, t: float, reading: Reading, source: str) -> None:
        found = self.navigator.step(Stamped(stamp_from_s(t), reading), source)
        if found is not None:
            self.out.append(found)

    def slow_sensors(self, t: float, number: int) -> None:
        """What has arrived since the last IMU sample."""
        sensors = self.vehicle.sensors

        def gauss(sigma: float) -> float:
            return self.random.gauss(0.0, sigma * self.noise)

        if number % 5 == 0 and self.deep:
            depth = self.point(t, sensors["ms5837"].position_m)[2]
            pressure = 101325.0 + 1000.0 * GRAVITY_mps2 * (depth + gauss(0.002))
            self.tell(t, Pressure(pressure, 20.0), "ms5837")
        if number % 9 == 0:
            field_T = rotate_back(matrix(self.attitude(t)), FIELD_T)
            self.tell(t, Magnetic(vector(a + b for a, b in zip(field_T, self.motors_T(t), strict=True))), "icm20948")
        if number % 10 == 0:
            self.acoustics(t, sensors, gauss)

    def acoustics(self, t: float, sensors: Mapping[str, Mount], gauss: Callable[[float], float]) -> None:
        if t < self.sonar_until_s:
            at = sensors["ping1d"].position_m
            slant = math.cos(max(0.0, math.acos(matrix(self.attitude(t))[2][2]) - math.radians(12.5)))
            self.tell(t, Echo((FLOOR_m - self.point(t, at)[2]) / slant + gauss(0.005), 0.9), "ping1d")
        end = t - self.dvl_delay_s
        mount = sensors["dvl75"]
        speeds = [self.velocity(end - 0.05 + 0.005 * k, mount.position_m) for k in range(11)]
        turn = matrix(vector(math.radians(x) for x in mount.rotation_deg))
        mean = rotate_back(turn, vector(sum(axis) / 11 for axis in zip(*speeds, strict=True)))
        mean = vector(one + gauss(0.01) for one in mean)
        known = self.dvl_from_s <= t < self.dvl_until_s
        self.tell(end - 0.025, BottomVelocity(mean if known else None, 0.01, 1.0, 0.05, 0), "dvl75")

    def run(self, seconds: float) -> "Ride":
        for number in range(1, round(seconds * 200)):
            t = number * 0.005
            self.tell(t, self.inertial(t, self.vehicle.sensors["icm20948"]), "icm20948")
            if number > 20:
                self.slow_sensors(t, number)
        return self

    def errors(
        self,
        value: Callable[[Navigation], float],
        truth: Callable[[float], float],
        after_s: float = 5.0,
    ) -> list[float]:
        return [value(one.reading) - truth(one.stamp * 1e-9) for one in self.out if one.stamp * 1e-9 > after_s]


def rms(values: list[float]) -> float:
    assert values
    return math.sqrt(sum(one * one for one in values) / len(values))
