"""`hindrax depth`: the air pressure from which depth is counted."""

from __future__ import annotations

import argparse
import statistics
import sys
from functools import partial
from pathlib import Path

from hindrax_analysis.plain import print_answer
from hindrax_cli.argument_types import add_i2c_port, add_json, add_vehicle
from hindrax_cli.vehicle_edit import require_editable, set_key
from hindrax_core.errors import HindraxError
from hindrax_core.readings import Pressure
from hindrax_core.text.screen_text import print_fitted
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.bus_capture import capture, mount_of
from hindrax_drivers.devices.ms5837 import Ms5837

NAME = "depth"
HELP = "measure the air pressure at the surface, from which depth is counted (tare)"
EXAMPLE = "./hindrax depth tare --write"
AIR_Pa = (80_000.0, 120_000.0)
CALM_Pa = 150.0
FEWEST = 20


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what to do, where the sensor is, and whether the vehicle file shall keep it."""
    parser.add_argument("action", choices=("tare",), help="the vehicle out of the water, or its sensor at the surface")
    add_vehicle(parser)
    add_i2c_port(parser)
    parser.add_argument("--seconds", type=float, default=3.0, metavar="S", help="how long to measure [s]")
    parser.add_argument("--write", action="store_true", help="put the result into the vehicle file")
    add_json(parser)


def run(arguments: argparse.Namespace) -> int:
    """Measure, judge, print and keep."""
    if arguments.write:
        require_editable(Path(arguments.vehicle))
    vehicle = load_vehicle(arguments.vehicle)
    _, mount = mount_of(vehicle, "ms5837")
    port = arguments.port or mount.port
    sensor = Ms5837(address=mount.address)
    told = partial(print_fitted, f"measuring the air pressure for {arguments.seconds:g} s", sys.stderr)
    heard = capture(port, sensor, arguments.seconds, lambda _: None, told)
    mean, spread = judged([one.pressure_Pa for one in heard.of(Pressure)])
    if arguments.write:
        set_key(Path(arguments.vehicle), ("water", "surface_pressure_Pa"), round(mean, 1))
    report = {
        "sensor": heard.identity,
        "surface_pressure_Pa": round(mean, 1),
        "spread_Pa": round(spread, 1),
        "before_Pa": vehicle.water.surface_pressure_Pa,
        "written": arguments.write,
    }
    kept = f"written to {arguments.vehicle}" if arguments.write else "not kept; --write puts it into the vehicle file"
    print_answer(report, f"surface pressure {mean:.1f} Pa (+/- {spread:.1f} Pa), {kept}", as_json=arguments.json)
    return 0


def judged(pressures_Pa: list[float]) -> tuple[float, float]:
    """Mean and standard deviation; HindraxError when this was not calm air."""
    if len(pressures_Pa) < FEWEST:
        raise HindraxError(f"found {len(pressures_Pa)} readings, wanted at least {FEWEST}; measure longer")
    mean, spread = statistics.fmean(pressures_Pa), statistics.stdev(pressures_Pa)
    low, high = AIR_Pa
    if not low <= mean <= high:
        raise HindraxError(f"found {mean:.0f} Pa, wanted air pressure ({low:.0f} to {high:.0f} Pa); surface first")
    if spread > CALM_Pa:
        raise HindraxError(
            f"pressure varies by {spread:.0f} Pa, wanted at most {CALM_Pa:.0f} Pa; keep the vehicle still"
        )
    return mean, spread
