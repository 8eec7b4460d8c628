"""Sensors that a turn or calm air calibrates, with the stack down: `hindrax imu` and `hindrax depth`."""

import argparse
import math
import statistics
from collections.abc import Mapping
from dataclasses import asdict
from functools import partial

from hindrax_analysis.records.bag_track import Vector
from hindrax_analysis.terminal import print_answer, working
from hindrax_bag.read.bag_reader import messages
from hindrax_cli.argument_types import add_i2c_port, add_json, add_sensor, add_vehicle
from hindrax_cli.command import command, option
from hindrax_cli.vehicle_edit import add_write, keep, require_editable
from hindrax_core import topics
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Inertial, Magnetic, Pressure, Vec3
from hindrax_core.text.screen_text import print_stderr
from hindrax_core.vehicle import Mount, load_vehicle
from hindrax_drivers.bus_capture import capture, measuring, mount_of, run_once
from hindrax_drivers.devices.icm20948 import Icm20948
from hindrax_drivers.devices.imu.icm20948_samples import Icm20948Knobs
from hindrax_drivers.devices.imu.icm20948_selftest import self_test
from hindrax_drivers.driver_registry import driver_of
from hindrax_drivers.imu_calibration import correction, fit_sphere, roundness

SLOW_radps = 0.15
"""While it turns no faster, the accelerometer sees gravity and little else."""
NEAR_GRAVITY = 0.15
AIR_Pa = (80_000.0, 120_000.0)
CALM_Pa = 150.0
FEWEST_SAMPLES = 20


@command(
    "./hindrax imu calibrate --seconds 90 --write",
    option("action", choices=("calibrate", "self-test"), help="self-test: the vehicle must stand still"),
    add_vehicle,
    add_sensor,
    add_i2c_port,
    option("--seconds", type=float, default=60.0, metavar="S", help="how long to turn [s]"),
    option("--bag", metavar="BAG", help="calibrate from a recorded turn instead of a live one"),
    add_write,
    add_json,
)
def imu(arguments: argparse.Namespace) -> int:
    """Calibrate magnetometer and accelerometer from a turn, or run the sensor's self test."""
    require_editable(arguments)
    name, mount = mount_of(load_vehicle(arguments.vehicle), Icm20948, arguments.sensor)
    port = arguments.port or mount.port
    if arguments.action == "self-test":
        return _self_test(port, mount, as_json=arguments.json)
    forces, fields = from_bag(arguments.bag, name, mount) if arguments.bag else live(port, mount, arguments.seconds)
    found, remarks = calibration(forces, fields, mount.calibration if arguments.bag else {})
    if found:
        block = {key: values for key, values in mount.calibration.items() if not key.endswith("_scale")} | found
        rounded = {key: [float(f"{one:.6g}") for one in values] for key, values in block.items()}
        keep(arguments, ("sensors", name, "calibration"), rounded)
    document = {"calibration": found, "remarks": remarks, "written": arguments.write and bool(found)}
    lines = [*remarks, *(f"{key}: {[float(f'{v:.6g}') for v in one]}" for key, one in found.items())]
    print_answer(document, "\n".join(lines), as_json=arguments.json)
    return 0 if found else 1


def live(port: str, mount: Mount, seconds: float) -> tuple[list[Vec3], list[Vec3]]:
    """Capture raw forces while the vehicle turns slowly, and raw fields, from the sensor itself.

    Parameters
    ----------
    port, mount
        Bus, and address of the sensor.
    seconds : [s]
        Of turning.

    Returns
    -------
    tuple[list[Vec3], list[Vec3]]
        Specific forces [m/s^2] and fields [T], in the axes of the chip.
    """
    task = f"turn the vehicle slowly about each axis, all the way round: {seconds:g} s"
    prompt = partial(print_stderr, task)
    sensor = Icm20948(Icm20948Knobs(), mount.address)
    with working("captured") as progress:
        captured = capture(port, sensor, seconds, lambda share: progress(f"{share:.0%}"), prompt)
    slow = [one for one in captured.of(Inertial) if max(abs(rate) for rate in one.rate_radps) < SLOW_radps]
    return [one.specific_force_mps2 for one in slow], [one.field_T for one in captured.of(Magnetic)]


def from_bag(bag: str, name: str, mount: Mount) -> tuple[list[Vec3], list[Vec3]]:
    """Read forces while the vehicle turned slowly, and fields, as recorded: corrected by the vehicle file of that time.

    Parameters
    ----------
    bag
        With the topics of the sensor.
    name, mount
        Of the sensor in the vehicle file.

    Returns
    -------
    tuple[list[Vec3], list[Vec3]]
        Specific forces [m/s^2] and fields [T], in the axes of the chip.
    """
    published = topics.sensor_topics(name, mount.device)
    inertial, magnetic = topics.resolved(published["data_raw"]), topics.resolved(published["mag"])
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
    """Fit spheres, and make entries for the vehicle file.

    Parameters
    ----------
    forces : [m/s^2]
        Those far from gravity do not count.
    fields : [T]
        In all directions.
    before
        Entries that were applied to the data already; the new ones hold both.

    Returns
    -------
    tuple[dict[str, tuple[float, ...]], list[str]]
        Entries, and one remark per sensor: how round it is now, or why there is none.
    """
    at_rest = [one for one in forces if abs(math.hypot(*one) / GRAVITY_mps2 - 1.0) < NEAR_GRAVITY]
    found: dict[str, tuple[float, ...]] = {}
    remarks = []
    for prefix, unit, points, radius in (("mag", "T", fields, None), ("accel", "mps2", at_rest, GRAVITY_mps2)):
        try:
            fitted = fit_sphere(points, radius)
        except HindraxError as error:
            slowly = f"; only samples at less than {SLOW_radps:g} rad/s count" if radius else ""
            remarks.append(f"{prefix}: {error}{slowly}")
            continue
        remarks.append(f"{prefix}: lengths differ by {roundness(points, fitted):.2%} after correction")
        found |= correction(before, prefix, unit).then(fitted).entries(prefix, unit)
    return found, remarks


def _self_test(port: str, mount: Mount, *, as_json: bool) -> int:
    sensor = Icm20948(Icm20948Knobs(magnetometer=False), mount.address)
    print_stderr(run_once(port, sensor.configure()).text)
    result = run_once(port, self_test(sensor.address))
    print_answer(asdict(result) | {"passed": result.passed}, result, as_json=as_json)
    return 0 if result.passed else 1


def _vector(message: Vector) -> Vec3:
    return (message.x, message.y, message.z)


@command(
    "./hindrax depth tare --write",
    option("action", choices=("tare",), help="the vehicle out of the water, or its sensor at the surface"),
    add_vehicle,
    add_sensor,
    add_i2c_port,
    option("--seconds", type=float, default=3.0, metavar="S", help="how long to measure [s]"),
    add_write,
    add_json,
)
def depth(arguments: argparse.Namespace) -> int:
    """Measure the air pressure at the surface, from which depth is counted (tare)."""
    require_editable(arguments)
    vehicle = load_vehicle(arguments.vehicle)
    name, mount = measuring(vehicle, "depth", arguments.sensor)
    row = driver_of(mount.device)
    if row.serial:
        raise UsageError(f"{name}: is on a serial line, wanted one on a bus; edit water.surface_pressure_Pa")
    sensor = row.make(row.knobs(), mount, vehicle)
    prompt = partial(print_stderr, f"measuring the air pressure for {arguments.seconds:g} s")
    captured = capture(arguments.port or mount.port, sensor, arguments.seconds, lambda _: None, prompt)
    mean, spread = judged([one.pressure_Pa for one in captured.of(Pressure)])
    kept = keep(arguments, ("water", "surface_pressure_Pa"), round(mean, 1))
    report = {
        "sensor": captured.identity,
        "surface_pressure_Pa": round(mean, 1),
        "spread_Pa": round(spread, 1),
        "before_Pa": vehicle.water.surface_pressure_Pa,
        "written": arguments.write,
    }
    text = f"surface pressure {mean:.1f} Pa (+/- {spread:.1f} Pa), {kept}"
    return print_answer(report, text, as_json=arguments.json)


def judged(pressures_Pa: list[float]) -> tuple[float, float]:
    """Mean and standard deviation; HindraxError when this was not calm air."""
    if len(pressures_Pa) < FEWEST_SAMPLES:
        raise HindraxError(f"found {len(pressures_Pa)} readings, wanted at least {FEWEST_SAMPLES}; measure longer")
    mean, spread = statistics.fmean(pressures_Pa), statistics.stdev(pressures_Pa)
    low, high = AIR_Pa
    if not low <= mean <= high:
        raise HindraxError(f"found {mean:.0f} Pa, wanted air pressure ({low:.0f} to {high:.0f} Pa); surface first")
    if spread > CALM_Pa:
        raise HindraxError(f"pressure varies by {spread:.0f} Pa, wanted at most {CALM_Pa:g} Pa; keep the vehicle still")
    return mean, spread
