"""From what the stack knows to what the identification learns from: the same lines live, over a bag and in lock-step.

Everything is told of the center of mass, about which the equations of motion are written.

Surge and sway come from the DVL as measured (moved to the center of mass), not from the navigator: its filter would
color their noise. Rates come from the gyroscope. Heave has no instrument of its own: its depth comes straight from the
pressure, for the same reason; the navigator's heave velocity serves where there is no pressure.
"""

from __future__ import annotations

import math
from typing import TypeAlias

from hindrax_core.events import Stamp, Stamped
from hindrax_core.readings import BottomVelocity, Pressure, Vec3, Vec6
from hindrax_core.rotation import apply, cross, matrix
from hindrax_core.state import NAN, Attitude, IdentEvent, Navigation, Phase, Thrust, Velocity
from hindrax_core.vehicle import GRAVITY_mps2, Mount, Vehicle
from hindrax_ident.sorter import InOrder

# ICM-20948 datasheet table 1: 0.015 dps/sqrt(Hz) over the noise bandwidth of a 50 Hz filter.
SIGMA_RATE_radps = math.radians(0.015) * math.sqrt(1.57 * 50.0)


Measurement: TypeAlias = BottomVelocity | Pressure | Navigation | Thrust | Phase


class Sorter(InOrder[Measurement]):
    """Measurements in order: what a feed is fed."""

    __slots__ = ()


class Feed:
    """Makes identification events out of measurements in the order of their stamps."""

    def __init__(self, vehicle: Vehicle, dvl: str = "dvl75", depth: str = "ms5837") -> None:
        """`dvl` and `depth`: names of their sensors in the vehicle file."""
        mount = vehicle.sensors.get(dvl, Mount(dvl))
        roll, pitch, yaw = (math.radians(angle) for angle in mount.rotation_deg)
        self._turn = matrix((roll, pitch, yaw))
        self._center_m = vehicle.center_of_mass_m
        self._dvl_lever_m = _minus(mount.position_m, self._center_m)
        self._below_sensor_m = _minus(self._center_m, vehicle.sensors.get(depth, Mount(depth)).position_m)
        self._rate_radps: Vec3 = (0.0, 0.0, 0.0)
        self._down: Vec3 = (0.0, 0.0, 1.0)
        self._surface_Pa = vehicle.water.surface_pressure_Pa
        self._Pa_per_m = vehicle.water.density_kgpm3 * GRAVITY_mps2

    def step(self, measurement: Stamped[Measurement]) -> tuple[Stamped[IdentEvent], ...]:
        """Events of one measurement; none while the DVL has no velocity."""
        stamp, reading = measurement.stamp, measurement.reading
        if isinstance(reading, BottomVelocity):
            return self._dvl(stamp, reading)
        if isinstance(reading, Pressure):
            depth_m = (reading.pressure_Pa - self._surface_Pa) / self._Pa_per_m + self._deeper_m(self._below_sensor_m)
            return (Stamped(stamp, Attitude((NAN, NAN, NAN), depth_m)),)
        if isinstance(reading, Navigation):
            return self._navigation(stamp, reading)
        return (Stamped(stamp, reading),)

    def _dvl(self, stamp: Stamp, reading: BottomVelocity) -> tuple[Stamped[IdentEvent], ...]:
        """Surge and sway of the center of mass: what rotation does at the DVL's lever is taken off."""
        if reading.velocity_mps is None:
            return ()
        turned = apply(self._turn, reading.velocity_mps)
        by_rotation = cross(self._rate_radps, self._dvl_lever_m)
        nu: Vec6 = (turned[0] - by_rotation[0], turned[1] - by_rotation[1], NAN, NAN, NAN, NAN)
        sigma = reading.sigma_mps
        return (Stamped(stamp, Velocity(nu, (sigma, sigma, NAN, NAN, NAN, NAN), "dvl")),)

    def _navigation(self, stamp: Stamp, state: Navigation) -> tuple[Stamped[IdentEvent], ...]:
        """Heave velocity, rates, attitude and depth; the navigator's velocity and depth are those of the origin."""
        self._rate_radps = state.rate_radps
        if math.isfinite(sum(state.attitude_rad)):
            self._down = _down(state.attitude_rad)
        heave_mps = state.velocity_mps[2] + cross(state.rate_radps, self._center_m)[2]
        nu: Vec6 = (NAN, NAN, heave_mps, *state.rate_radps)
        rate = SIGMA_RATE_radps
        sigma: Vec6 = (NAN, NAN, state.velocity_sigma_mps[2], rate, rate, rate)
        return (
            Stamped(stamp, Velocity(nu, sigma, "navigation")),
            Stamped(stamp, Attitude(state.attitude_rad, state.depth_m + self._deeper_m(self._center_m))),
        )

    def _deeper_m(self, lever_m: Vec3) -> float:
        """By how much the end of a lever in body axes is deeper than its beginning."""
        return sum(share * length for share, length in zip(self._down, lever_m, strict=True))


def _down(attitude_rad: Vec3) -> Vec3:
    """Downward direction in body axes. Fossen 2011 eq. 2.18, last row."""
    roll, pitch, _ = attitude_rad
    return (-math.sin(pitch), math.cos(pitch) * math.sin(roll), math.cos(pitch) * math.cos(roll))


def _minus(a: Vec3, b: Vec3) -> Vec3:
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])
