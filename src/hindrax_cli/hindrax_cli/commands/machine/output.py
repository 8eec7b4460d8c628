"""The thruster output at the bench: `hindrax oscillator` measures its clock, `hindrax esc` teaches its pulses.

The steps of `esc` are those of BLHeli (operation manual for SiLabs chips, rev. 10.x, "Throttle range calibration", PPM
input), the family of the Basic ESC: full throttle from power-up until it is stored, then the least until that is too.
"""

import argparse
import sys
from dataclasses import dataclass

from hindrax_analysis.terminal import print_answer
from hindrax_bringup.stack_lock import vehicle_stack
from hindrax_cli.argument_types import add_i2c_port, add_json, add_tuning, add_vehicle, output_settings
from hindrax_cli.command import command, option
from hindrax_cli.interrupt import hung_up_alike
from hindrax_cli.vehicle_edit import add_write, keep, require_editable
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.readings import Battery
from hindrax_core.text.screen_text import print_fitted, print_stderr
from hindrax_core.vehicle import Vehicle, chip_and_line
from hindrax_drivers.bus_capture import capture, run_once
from hindrax_drivers.buses.clock import MOCK_PREFIX
from hindrax_drivers.devices.pca9685 import NOMINAL_CLOCK_Hz, Pca9685, pca9685_of
from hindrax_drivers.driver_registry import driver_of
from hindrax_drivers.output import oscillator as measurement
from hindrax_drivers.output.enable_line import outputs_enabled

GUIDE = """Keep fingers off the propellers: the thrusters get their neutral pulse.
Wire the signal pin of channel {channel} to GPIO {gpio} and the grounds together.
The PCA9685 must run from 3.3 V: 5 V destroys the GPIO."""
FULL_us, LEAST_us = 1900.0, 1100.0
SUPPLIED_V = 3.0
SWITCH_OFF = "Switch the supply of the speed controllers OFF, then type off:"
SWITCH_ON = (
    "Full throttle is on {names}. Switch their supply ON; 3 s later they beep that it is stored: press Enter then."
)
STORED = "Zero throttle is on them. After the beeps that follow 3 s of it, switch the supply OFF again and press Enter:"


@command(
    "./hindrax oscillator --channel 15 --gpio pinctrl-bcm2711:17 --write",
    add_vehicle,
    option("--channel", type=int, default=15, metavar="N", help="spare channel of the PCA9685, 0 to 15"),
    option("--gpio", default="pinctrl-bcm2711:17", metavar="CHIP:LINE", help="GPIO that it is wired to"),
    add_i2c_port,
    option("--seconds", type=float, default=10.0, metavar="S", help="how long to measure [s]"),
    add_write,
    add_json,
    add_tuning,
)
def oscillator(arguments: argparse.Namespace) -> int:
    """Measure the oscillator of the PCA9685 on a spare channel wired back to a GPIO."""
    require_editable(arguments)
    settings = output_settings(arguments)
    vehicle = settings.vehicle
    chip, line = _gpio(arguments.gpio)
    _require_channel(vehicle, arguments.channel)
    require_output_free(vehicle)
    output, port = vehicle.output, arguments.port or settings.port
    run_once(port, measurement.look(output.address, chip, line))
    print_stderr(GUIDE.format(channel=arguments.channel, gpio=arguments.gpio))
    with outputs_enabled(output, port):
        identity = run_once(port, pca9685_of(vehicle, settings.guard.neutral.all_us).configure()).text
        prescale = run_once(port, measurement.begin(output.address, arguments.channel))
        try:
            print_stderr(f"measuring for {arguments.seconds:g} s")
            edges = run_once(port, measurement.edges(chip, line, arguments.seconds))
            found_Hz = measurement.clock_Hz(edges, prescale)
        finally:
            run_once(port, measurement.end(output.address, arguments.channel))
    kept = keep(arguments, ("output", "clock_Hz"), round(found_Hz))
    before_Hz = NOMINAL_CLOCK_Hz if output.clock_Hz is None else output.clock_Hz
    percent = 100.0 * (found_Hz / before_Hz - 1.0)
    report = {
        "output": identity,
        "clock_Hz": round(found_Hz),
        "before_Hz": before_Hz,
        "edges": edges[-1][0] - edges[0][0],
        "written": arguments.write,
    }
    text = f"oscillator {found_Hz / 1e6:.4f} MHz, {percent:+.2f} % from the vehicle file, {kept}"
    return print_answer(report, text, as_json=arguments.json)


def _gpio(name: str) -> tuple[str, int]:
    try:
        return chip_and_line(name, "--gpio")
    except ValueError as error:
        raise UsageError(str(error)) from error


def require_output_free(vehicle: Vehicle) -> None:
    """UsageError where another output is on board, HindraxError where a stack that is up has it."""
    if vehicle.output.device != "pca9685":
        raise UsageError(f"output.device: found {vehicle.output.device}, wanted pca9685")
    if (up := vehicle_stack()) is not None:
        raise HindraxError(f"a stack is up (process {up.pid}) and has the output; end it first")


def _require_channel(vehicle: Vehicle, channel: int) -> None:
    taken = {*(one.channel for one in vehicle.thrusters), *vehicle.output.light_channels}
    if channel not in range(16) or channel in taken:
        free = ", ".join(str(one) for one in range(16) if one not in taken)
        raise UsageError(f"--channel: found {channel}, wanted one without thruster or lamp: {free}")


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
        for name in self.vehicle.measuring("supply"):
            mount = self.vehicle.sensors[name]
            row = driver_of(mount.device)
            port = self.port if self.port.startswith(MOCK_PREFIX) else mount.port
            captured = capture(port, row.make(row.knobs(), mount, self.vehicle), 0.5, lambda _part: None)
            found_V = max((one.voltage_V for one in captured.of(Battery)), default=0.0)
            if found_V > SUPPLIED_V:
                raise HindraxError(
                    f"{name}: found {found_V:.1f} V, wanted the speed controllers without supply; switch it off. Feed "
                    "this computer from another supply; a copy of the vehicle file may do without a sensor of that one"
                )


@command(
    "./hindrax esc calibrate --thrusters T1 T2 --propellers-off",
    option("action", choices=("calibrate",), help="calibrate full and zero throttle"),
    add_vehicle,
    option("--thrusters", nargs="+", default=(), metavar="T1", help="default: all of the vehicle"),
    option("--propellers-off", action="store_true", help="confirm that every propeller is off"),
    add_i2c_port,
    add_tuning,
)
def esc(arguments: argparse.Namespace) -> int:
    """Calibrate the throttle range of the speed controllers, propellers off."""
    settings = output_settings(arguments)
    vehicle = settings.vehicle
    known = tuple(one.name for one in vehicle.thrusters)
    names = tuple(dict.fromkeys(arguments.thrusters)) or known
    unknown = [name for name in names if name not in known]
    if unknown:
        raise UsageError(f"--thrusters: found {unknown[0]}, wanted thrusters of {', '.join(known)}")
    require_output_free(vehicle)
    if not arguments.propellers_off:
        raise UsageError("remove every propeller, then add --propellers-off: this command outputs full throttle")
    chip = pca9685_of(vehicle, settings.guard.neutral.all_us)
    bench = _Bench(vehicle, chip, arguments.port or settings.port, names)
    with hung_up_alike(), outputs_enabled(vehicle.output, bench.port):
        _calibrate(bench)
    print_fitted(
        f"calibrated to {LEAST_us:g} and {FULL_us:g} us: {', '.join(names)}; check one with `./hindrax thruster`"
    )
    return 0


def _calibrate(bench: _Bench) -> None:
    run_once(bench.port, bench.chip.configure())
    output = bench.vehicle.output
    if output.clock_Hz is None and not output.external_clock:
        print_fitted("output.clock_Hz is not measured: `./hindrax oscillator` first, or the range has the same error")
    if _ask(SWITCH_OFF) != "off":
        raise HindraxError("wanted `off`; only neutral was written")
    bench.require_no_supply()
    try:
        bench.put(FULL_us)
        _ask(SWITCH_ON.format(names=", ".join(bench.names)))
        bench.put(LEAST_us)
        _ask(STORED)
    finally:
        run_once(bench.port, bench.chip.hold())


def _ask(question: str) -> str:
    print_fitted(question, sys.stderr, end=" ")
    line = sys.stdin.readline()
    if not line:
        raise HindraxError("the input ended, wanted an answer at each step; the pulses are neutral")
    return line.strip().lower()
