"""`hindrax dvl`: what the DVL keeps in its flash, shown and set. Nothing else in the stack changes these settings."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Mapping
from contextlib import closing
from dataclasses import replace
from typing import Any

from hindrax_bringup.share_files import default_vehicle
from hindrax_core.bus_operations import DeviceError
from hindrax_core.driver_interface import Identity, Output, Send
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.events import after
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_drivers.buses.clock import Clock, SystemClock
from hindrax_drivers.buses.line import open_line
from hindrax_drivers.devices.dvl75 import Dvl75, Dvl75Knobs, setup_commands

NAME = "dvl"
HELP = "show or set what the DVL keeps in its flash"
EXAMPLE = "./hindrax dvl setup --dry-run"
ANSWER_S = 2.0
FLASH_S = 0.5
"""Time given to the device after a command, which it writes to flash."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare what to do, where the DVL is, and what shall hold."""
    parser.add_argument("action", choices=("show", "setup"), help="show the settings, or set those that differ")
    parser.add_argument("--vehicle", default=str(default_vehicle()), metavar="FILE", help="vehicle file")
    parser.add_argument(
        "--port", metavar="PATH", help="serial port, or udp://ADDRESS:PORT; default: of the vehicle file"
    )
    parser.add_argument(
        "--speed-of-sound", type=float, metavar="M_PER_S", help="wanted [m/s]; default: of the vehicle file's water"
    )
    parser.add_argument("--velocity-adjustment", type=float, default=1.0, metavar="FACTOR", help="wanted [-]")
    parser.add_argument("--always", action="store_true", help="send also what holds already; wears the flash")
    parser.add_argument("--dry-run", action="store_true", help="only say what would be sent")
    parser.add_argument("--json", action="store_true", help="one JSON document on stdout")


def run(arguments: argparse.Namespace) -> int:
    """Talk to the DVL and print what came of it."""
    vehicle = load_vehicle(arguments.vehicle)
    port = arguments.port or port_of(vehicle)
    knobs = wanted_knobs(vehicle, arguments.speed_of_sound, arguments.velocity_adjustment)
    clock = SystemClock()
    try:
        with closing(DvlConversation(port, knobs, clock)) as talk:
            report = talk.show() if arguments.action == "show" else talk.set_up(arguments.always, arguments.dry_run)
    except DeviceError as error:
        raise HindraxError(str(error)) from error
    finally:
        clock.close()
    print(json.dumps(report) if arguments.json else "\n".join(lines(report)))
    return 0


def port_of(vehicle: Vehicle) -> str:
    """Port of the vehicle's DVL."""
    for mount in vehicle.sensors.values():
        if mount.device == "dvl75" and mount.port:
            return mount.port
    raise UsageError(f"vehicle {vehicle.name}: found no sensor with device dvl75 and a port; name one with --port")


def wanted_knobs(vehicle: Vehicle, speed_of_sound_mps: float | None, velocity_adjustment: float) -> Dvl75Knobs:
    """Settings that shall hold, within what the device takes."""
    speed = vehicle.water.speed_of_sound_mps if speed_of_sound_mps is None else speed_of_sound_mps
    if not 1100.0 <= speed <= 1950.0:
        raise UsageError(f"--speed-of-sound: found {speed:g}, wanted 1100 to 1950 m/s")
    if not 0.8 <= velocity_adjustment <= 1.25:
        raise UsageError(f"--velocity-adjustment: found {velocity_adjustment:g}, wanted 0.8 to 1.25")
    return replace(Dvl75Knobs(), speed_of_sound_mps=speed, velocity_adjustment=velocity_adjustment, enable_tries=0)


class DvlConversation:
    """One conversation with a DVL over its port."""

    def __init__(self, path: str, knobs: Dvl75Knobs, clock: Clock) -> None:
        self._path, self._knobs, self._clock = path, knobs, clock
        self._device = Dvl75(knobs)
        self._port = open_line(path, self._device.baud, clock)
        self._identity = ""

    def close(self) -> None:
        """Give the port back."""
        self._port.close()

    def show(self) -> dict[str, Any]:
        """Identity and settings, as far as the device tells them."""
        settings = dict(self._ask())
        return {"port": self._path, "identity": self._identity, "settings": settings}

    def set_up(self, always: bool, dry_run: bool) -> dict[str, Any]:
        """Send what differs (or everything), then ask again and say what still differs."""
        orders = setup_commands(self._ask(), self._knobs, always)
        report: dict[str, Any] = {"port": self._path, "identity": self._identity, "orders": _texts(orders)}
        if dry_run:
            return report | {"sent": False}
        for order in orders:
            print(f"sending {order.decode().strip()}", file=sys.stderr, flush=True)
            self._port.send(Send(order))
            self._listen(FLASH_S)
        settings = self._ask()
        left = setup_commands(settings, self._knobs) if settings else ()
        if left:
            raise HindraxError(f"{self._path}: DVL did not take {', '.join(_texts(left))}; check its firmware")
        return report | {"sent": True, "verified": bool(settings), "settings": dict(settings)}

    def _ask(self) -> Mapping[str, str]:
        """Ask for the configuration; empty when a DVL is there that does not report it."""
        self._device = Dvl75(self._knobs)
        for output in self._device.start(self._clock.now()):
            if isinstance(output, Send):
                self._port.send(output)
        heard = self._listen(ANSWER_S, until_configured=True)
        if not self._identity:
            found = "other bytes" if heard else "silence"
            raise HindraxError(
                f"{self._path}: found {found}, wanted a DVL at {self._device.baud} baud; check power, cable and speed"
            )
        return self._device.configuration

    def _listen(self, seconds: float, *, until_configured: bool = False) -> int:
        """Hear the device out; returns the number of bytes."""
        end, count = after(self._clock.now(), seconds), 0
        while self._clock.now() < end and not (until_configured and self._device.configuration):
            self._port.wait(end)
            data, stamp = self._port.read()
            count += len(data)
            self._note(self._device.feed(data, stamp))
        return count

    def _note(self, outputs: Iterable[Output]) -> None:
        for output in outputs:
            if isinstance(output, Identity):
                self._identity = output.text


def _texts(orders: Iterable[bytes]) -> list[str]:
    return [order.decode("ascii").strip() for order in orders]


def lines(report: Mapping[str, Any]) -> list[str]:
    """Return the report as lines for a person."""
    found = [f"{report['identity']} on {report['port']}"]
    if "settings" in report:
        found += [f"  {key}: {value}" for key, value in report["settings"].items()] or ["  settings: not reported"]
    if "orders" in report:
        verb = "sent" if report["sent"] else "would send"
        found += [f"{verb}: {order}" for order in report["orders"]] or ["nothing to change"]
    if report.get("sent") and not report["verified"]:
        found.append("the device does not report its settings, so they could not be verified")
    return found
