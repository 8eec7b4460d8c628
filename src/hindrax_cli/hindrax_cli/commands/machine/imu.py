"""`hindrax imu`: offsets and distortion of magnetometer and accelerometer from a turn, and the sensor's self test."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from hindrax_analysis.plain import print_answer, print_json
from hindrax_bag.read.bag_reader import messages
from hindrax_cli.argument_types import add_i2c_port, add_json, add_vehicle
from hindrax_cli.vehicle_edit import require_editable, set_key
from hindrax_core import topics
from hindrax_core.errors import HindraxError
from hindrax_core.readings import Inertial, Magnetic, Vec3
from hindrax_core.text.screen_text import print_fitted, print_whole
from hindrax_core.vehicle import GRAVITY_mps2, Mount, load_vehicle
from hindrax_drivers.bus_capture import capture, mount_of, run_once
from hindrax_drivers.devices.icm20948 import Icm20948
from hindrax_drivers.devices.imu.icm20948_samples import Icm20948Knobs
from hindrax_drivers.devices.imu.icm20948_selftest import self_test
from hindrax_drivers.imu_calibration import correction, fit_sphere, roundness

NAME = "imu"
HELP = "calibrate magnetometer and accelerometer from a turn, or run the sensor's self test"
EXAMPLE = "./hindrax imu calibrate --seconds 90 --write"
SLOW_radps = 0.15
"""While it turns no faster, the accelerometer sees gravity and little else."""
NEAR_GRAVITY = 0.15


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what to do, where the data come from, and whether the vehicle file shall keep the result."""
    parser.add_argument("action", choices=("calibrate", "self-test"), help="self-test: the vehicle must stand still")
    add_vehicle(parser)
    add_i2c_port(parser)
    parser.add_argument("--seconds", type=float, default=60.0, metavar="S", help="how long to turn [s]")
    parser.add_argument("--bag", metavar="BAG", help="calibrate from a recorded turn instead of a live one")
    parser.add_argument("--write", action="store_true", help="put the result into the vehicle file")
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Calibrate or test, print what came of it."""
    if arguments.write:
        require_editable(Path(arguments.vehicle))
    name, mount = mount_of(load_vehicle(arguments.vehicle), "icm20948")
    port = arguments.port or mount.port
    if arguments.action == "self-test":
        return _self_test(port, mount, as_json=arguments.json)
    if arguments.bag:
        forces, fields = from_bag(arguments.bag)
    else:
        forces, fields = live(port, mount, arguments.seconds)
    found, remarks = calibration(forces, fields, mount.calibration if arguments.bag else {})
    if arguments.write and found:
        block = {key: values for key, values in mount.calibration.items() if not key.endswith("_scale")} | found
        rounded = {key: [float(f"{one:.6g}") for one in values] for key, values in block.items()}
        set_key(Path(arguments.vehicle), ("sensors", name, "calibration"), rounded)
    if arguments.json:
        print_json({"calibration": found, "remarks": remarks, "written": arguments.write and bool(found)})
    else:
        print_fitted(
            "\n".join([*remarks, *(f"{key}: {[float(f'{v:.6g}') for v in one]}" for key, one in found.items())])
        )
    return 0 if found else 1


def live(port: str, mount: Mount, seconds: float) -> tuple[list[Vec3], list[Vec3]]:
    """Raw forces while turning slowly, and raw fields, heard from the sensor itself."""
    told = partial(
        print_fitted, f"turn the vehicle slowly about each axis, all the way round: {seconds:g} s", sys.stderr
    )
    heard = capture(port, Icm20948(Icm20948Knobs(), mount.address), seconds, _progress, told)
    slow = [one for one in heard.of(Inertial) if max(abs(rate) for rate in one.rate_radps) < SLOW_radps]
    return [one.specific_force_mps2 for one in slow], [one.field_T for one in heard.of(Magnetic)]


def from_bag(bag: str) -> tuple[list[Vec3], list[Vec3]]:
    """Forces while turning slowly, and fields, as they were recorded: corrected as the vehicle file then said."""
    inertial, magnetic = topics.resolved(topics.IMU), topics.resolved(topics.MAGNETIC)
    forces: list[Vec3] = []
    fields: list[Vec3] = []
    for one in messages(bag, (inertial, magnetic)):
        message = one.decoded()
        if one.topic == magnetic:
            fields.append(_vector(message.magnetic_field))
        elif max(abs(rate) for rate in _vector(message.angular_velocity)) < SLOW_radps:
            forces.append(_vector(message.linear_acceleration))
    return forces, fields


def calibration(
    forces: list[Vec3], fields: list[Vec3], before: Mapping[str, tuple[float, ...]]
) -> tuple[dict[str, tuple[float, ...]], list[str]]:
    """Entries for the vehicle file, and one remark per sensor. `before` is what was applied to the data already."""
    at_rest = [one for one in forces if abs(_length(one) / GRAVITY_mps2 - 1.0) < NEAR_GRAVITY]
    found: dict[str, tuple[float, ...]] = {}
    remarks = []
    for prefix, unit, points, radius in (("mag", "T", fields, None), ("accel", "mps2", at_rest, GRAVITY_mps2)):
        try:
            fitted = fit_sphere(points, radius)
        except HindraxError as error:
            slowly = f"; only what it feels at less than {SLOW_radps:g} rad/s counts" if radius else ""
            remarks.append(f"{prefix}: {error}{slowly}")
            continue
        remarks.append(f"{prefix}: lengths differ by {roundness(points, fitted):.2%} after correction")
        found |= correction(before, prefix, unit).then(fitted).entries(prefix, unit)
    return found, remarks


def _self_test(port: str, mount: Mount, *, as_json: bool) -> int:
    sensor = Icm20948(Icm20948Knobs(magnetometer=False), mount.address)
    print_fitted(run_once(port, sensor.configure()).text, sys.stderr)
    result = run_once(port, self_test(mount.address or 0x68))
    print_answer(asdict(result) | {"passed": result.passed}, result, as_json=as_json)
    return 0 if result.passed else 1


def _progress(share: float) -> None:
    if sys.stderr.isatty():
        print_whole(f"\r{share:4.0%}", sys.stderr, end="")


def _vector(message: Any) -> Vec3:
    return (message.x, message.y, message.z)


def _length(vector: Vec3) -> float:
    return float(sum(one * one for one in vector) ** 0.5)
