"""`hindrax oscillator`: the clock of the PCA9685, measured by pulses that are wired back to a GPIO."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from hindrax_analysis.plain import print_answer
from hindrax_bringup.stack_lock import vehicle_stack
from hindrax_cli.argument_types import add_i2c_port, add_json, add_tuning, add_vehicle
from hindrax_cli.output_settings import output_settings
from hindrax_cli.vehicle_edit import require_editable, set_key
from hindrax_core.bus_operations import DeviceError
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.text.screen_text import print_fitted
from hindrax_core.vehicle import Vehicle, chip_and_line
from hindrax_drivers.bus_capture import run_once
from hindrax_drivers.devices.pca9685 import pca9685_of
from hindrax_drivers.output import oscillator
from hindrax_drivers.output.enable_line import outputs_enabled

NAME = "oscillator"
HELP = "measure the oscillator of the PCA9685 by a spare channel that is wired back to a GPIO"
EXAMPLE = "./hindrax oscillator --channel 15 --gpio pinctrl-bcm2711:17 --write"
GUIDE = """Keep fingers off the propellers: the thrusters get their neutral pulse.
Wire the signal pin of channel {channel} to GPIO {gpio} and the grounds together.
The PCA9685 must run from 3.3 V: 5 V destroys the GPIO."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the wire, for how long, and whether the vehicle file shall keep the result."""
    add_vehicle(parser)
    parser.add_argument("--channel", type=int, default=15, metavar="N", help="spare channel of the PCA9685, 0 to 15")
    parser.add_argument("--gpio", default="pinctrl-bcm2711:17", metavar="CHIP:LINE", help="where it is wired to")
    add_i2c_port(parser)
    parser.add_argument("--seconds", type=float, default=10.0, metavar="S", help="how long to measure [s]")
    parser.add_argument("--write", action="store_true", help="put the result into the vehicle file")
    add_json(parser)
    add_tuning(parser)


def run(arguments: argparse.Namespace) -> int:
    """Measure, print and keep."""
    if arguments.write:
        require_editable(Path(arguments.vehicle))
    settings = output_settings(arguments)
    vehicle = settings.vehicle
    chip, line = _gpio(arguments.gpio)
    _require_channel(vehicle, arguments.channel)
    require_output_free(vehicle)
    output, port = vehicle.output, arguments.port or settings.port
    run_once(port, oscillator.look(output.address, chip, line))
    print_fitted(GUIDE.format(channel=arguments.channel, gpio=arguments.gpio), sys.stderr)
    with outputs_enabled(output, port):
        identity = run_once(port, pca9685_of(vehicle, settings.guard.neutral.all_us).configure()).text
        prescale = run_once(port, oscillator.begin(output.address, arguments.channel))
        try:
            print_fitted(f"measuring for {arguments.seconds:g} s", sys.stderr)
            edges = run_once(port, oscillator.edges(chip, line, arguments.seconds))
            found_Hz = oscillator.clock_Hz(edges, prescale)
        except DeviceError as error:
            raise HindraxError(str(error)) from error
        finally:
            run_once(port, oscillator.end(output.address, arguments.channel))
    if arguments.write:
        set_key(Path(arguments.vehicle), ("output", "clock_Hz"), round(found_Hz))
    percent = 100.0 * (found_Hz / output.clock_Hz - 1.0)
    report = {
        "output": identity,
        "clock_Hz": round(found_Hz),
        "before_Hz": output.clock_Hz,
        "edges": edges[-1][0] - edges[0][0],
        "written": arguments.write,
    }
    kept = f"written to {arguments.vehicle}" if arguments.write else "not kept; --write puts it into the vehicle file"
    said = f"oscillator {found_Hz / 1e6:.4f} MHz, {percent:+.2f} % of what the vehicle file has, {kept}"
    print_answer(report, said, as_json=arguments.json)
    return 0


def _gpio(name: str) -> tuple[str, int]:
    try:
        return chip_and_line(name, "--gpio")
    except ValueError as error:
        raise UsageError(str(error)) from error


def require_output_free(vehicle: Vehicle) -> None:
    """Refuse where another output is on board, or a stack that is up has it."""
    if vehicle.output.device != "pca9685":
        raise UsageError(f"output.device: found {vehicle.output.device}, wanted pca9685")
    if (up := vehicle_stack()) is not None:
        raise HindraxError(f"a stack is up (process {up.pid}) and has the output; end it first")


def _require_channel(vehicle: Vehicle, channel: int) -> None:
    taken = {*(one.channel for one in vehicle.thrusters), *vehicle.output.light_channels}
    if channel not in range(16) or channel in taken:
        free = ", ".join(str(one) for one in range(16) if one not in taken)
        raise UsageError(f"--channel: found {channel}, wanted one without thruster or lamp: {free}")
