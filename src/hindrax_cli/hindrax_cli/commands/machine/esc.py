"""`hindrax esc`: the throttle range of the speed controllers, taught by the pulses that this vehicle makes.

The steps are those of BLHeli (operation manual for SiLabs chips, rev. 10.x, "Throttle range calibration", PPM input),
the family of the Basic ESC: full throttle from power-up until it is stored, then the least until that is stored.
"""

from __future__ import annotations

import argparse
import signal
import sys
from dataclasses import dataclass

from hindrax_cli.argument_types import add_i2c_port, add_tuning, add_vehicle
from hindrax_cli.commands.machine.oscillator import require_output_free
from hindrax_cli.output_settings import output_settings
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.readings import Battery
from hindrax_core.text.screen_text import print_fitted
from hindrax_core.vehicle import Vehicle
from hindrax_drivers.bus_capture import capture, run_once
from hindrax_drivers.buses.clock import MOCK_PREFIX
from hindrax_drivers.devices.pca9685 import Pca9685, pca9685_of
from hindrax_drivers.driver_registry import DEVICES
from hindrax_drivers.output.enable_line import outputs_enabled

NAME = "esc"
HELP = "teach the speed controllers their throttle range, the propellers off"
EXAMPLE = "./hindrax esc calibrate --thrusters T1 T2 --propellers-off"
FULL_us, LEAST_us = 1900.0, 1100.0
SUPPLIED_V = 3.0
BATTERY_SENSORS = ("ina226", "ads1115")
OFF = "Switch the supply of the speed controllers OFF, then type off: "
ON = "Full throttle is on {names}. Switch their supply ON; 3 s later they beep that it is stored: press Enter then. "
STORED = (
    "Least throttle is on them. After the beeps that follow 3 s of it, switch the supply OFF again and press Enter: "
)


@dataclass(frozen=True, slots=True)
class _Bench:
    """The chip on its bus, and the thrusters that are calibrated."""

    vehicle: Vehicle
    chip: Pca9685
    port: str
    names: tuple[str, ...]

    def put(self, pulse_us: float) -> None:
        """Put a pulse on the chosen thrusters, rest on all other channels, and read it back."""
        pulses = list(self.chip.rest_us)
        for index, thruster in enumerate(self.vehicle.thrusters):
            pulses[index] = pulse_us if thruster.name in self.names else pulses[index]
        run_once(self.port, self.chip.write(pulses))
        run_once(self.port, self.chip.check(pulses))

    def require_no_supply(self) -> None:
        """HindraxError when a battery sensor of the vehicle sees a supply: full throttle would turn the thrusters."""
        for name, mount in self.vehicle.sensors.items():
            if mount.device not in BATTERY_SENSORS:
                continue
            row = DEVICES[mount.device]
            port = self.port if self.port.startswith(MOCK_PREFIX) else mount.port
            heard = capture(port, row.make(row.knobs(), mount, self.vehicle), 0.5, lambda _part: None)
            found_V = max((one.voltage_V for one in heard.of(Battery)), default=0.0)
            if found_V > SUPPLIED_V:
                raise HindraxError(
                    f"{name}: found {found_V:.1f} V, wanted the speed controllers without supply; switch it off. Feed "
                    "this computer from another supply; a copy of the vehicle file may do without a sensor of that one"
                )


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the thrusters, and the word that nothing can be hurt."""
    parser.add_argument("action", choices=("calibrate",), help="teach full and least throttle")
    add_vehicle(parser)
    parser.add_argument("--thrusters", nargs="+", default=(), metavar="T1", help="default: all of the vehicle")
    parser.add_argument("--propellers-off", action="store_true", help="say that every propeller is off")
    add_i2c_port(parser)
    add_tuning(parser)


def run(arguments: argparse.Namespace) -> int:
    """Lead through the steps; whatever ends them ends with neutral pulses."""
    settings = output_settings(arguments)
    vehicle = settings.vehicle
    known = tuple(one.name for one in vehicle.thrusters)
    names = tuple(dict.fromkeys(arguments.thrusters)) or known
    unknown = [name for name in names if name not in known]
    if unknown:
        raise UsageError(f"--thrusters: found {unknown[0]}, wanted thrusters of {', '.join(known)}")
    require_output_free(vehicle)
    if not arguments.propellers_off:
        raise UsageError("take every propeller off, then say --propellers-off: this puts full throttle out")
    chip = pca9685_of(vehicle, settings.guard.neutral.all_us)
    bench = _Bench(vehicle, chip, arguments.port or settings.port, names)
    for number in (signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.default_int_handler)
    with outputs_enabled(vehicle.output, bench.port):
        _calibrate(bench)
    print_fitted(
        f"calibrated to {LEAST_us:g} and {FULL_us:g} us: {', '.join(names)}; look at one with `./hindrax thruster`"
    )
    return 0


def _calibrate(bench: _Bench) -> None:
    run_once(bench.port, bench.chip.configure())
    output = bench.vehicle.output
    if output.clock_Hz == type(output)().clock_Hz and not output.external_clock:
        print_fitted(
            "output.clock_Hz is the nominal one: `./hindrax oscillator` first, or the range is off as far as it is"
        )
    if _ask(OFF) != "off":
        raise HindraxError("wanted the word off; nothing but neutral was put out")
    bench.require_no_supply()
    try:
        bench.put(FULL_us)
        _ask(ON.format(names=", ".join(bench.names)))
        bench.put(LEAST_us)
        _ask(STORED)
    finally:
        run_once(bench.port, bench.chip.hold())


def _ask(question: str) -> str:
    print_fitted(question, sys.stderr, end="")
    line = sys.stdin.readline()
    if not line:
        raise HindraxError("the input ended, wanted an answer at each step; the pulses are neutral")
    return line.strip().lower()
