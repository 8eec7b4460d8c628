"""Checks of buses, ports and devices through the drivers, with the stack down."""

import contextlib
import grp
import os
import stat
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from hindrax_cli.health_checks import Check
from hindrax_core.bus_operations import DeviceError
from hindrax_core.driver_interface import Identity, Send, SerialDevice, Trouble
from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamped, after, seconds_between
from hindrax_core.readings import SonarHealth
from hindrax_core.vehicle import Mount, Vehicle, chip_and_line
from hindrax_drivers.bus_capture import capture
from hindrax_drivers.buses.clock import MOCK_PREFIX, Clock
from hindrax_drivers.buses.gpio import GPIO_PREFIX, find_chip
from hindrax_drivers.buses.line import UDP_IN, UDP_PREFIX, at_baud, is_network, open_line
from hindrax_drivers.buses.ports import open_clock
from hindrax_drivers.driver_registry import driver_of
from hindrax_drivers.nodes.thruster_settings import Settings
from hindrax_drivers.output.output_ports import open_output, set_up_patiently
from hindrax_sim.buses.mounted_file import is_mounted

ANSWER_S = 4.0
RATE_S = 1.0
TURN_S = 0.05
ABSENT = "not there"

Ports = Mapping[str, str]
"""Port by the name of a sensor, or "thrusters"; where none is named, that of the vehicle file holds."""


def ports(vehicle: Vehicle, instead: Ports) -> list[Check]:
    """Every port once: whether it exists, its kind, and whether this user may open it."""
    own = [(name, mount) for name, mount in vehicle.sensors.items() if name not in vehicle.on_output_line]
    wanted = [instead.get(name, mount.port) for name, mount in own]
    if vehicle.output.device != "ros2_control":  # its port is a topic
        wanted.append(instead.get("thrusters", vehicle.output.port))
    wanted += [
        f"{GPIO_PREFIX}{chip_and_line(mount.data_ready, name)[0]}"
        for name, mount in vehicle.sensors.items()
        if mount.data_ready and name not in instead
    ]
    return [port(path) for path in dict.fromkeys(wanted)]


def require_ports(vehicle: Vehicle, file: str) -> None:
    """HindraxError when a port of the vehicle file does not exist: there is no use in waiting for it."""
    checks = ports(vehicle, {})
    missing = [one.name for one in checks if one.found == ABSENT]
    if missing:
        raise HindraxError(
            f"{file}: found no {', '.join(missing)} on this machine, wanted all {len(checks)} ports of the vehicle; "
            "check cable and power (`./hindrax doctor` has the remedy of each), leave out of the file what the vehicle "
            "does not carry, or fly without one: --mock"
        )


def port(path: str) -> Check:
    """Whether a port exists and can be opened."""
    if path.startswith((UDP_PREFIX, UDP_IN)):
        return Check(path, "an address to listen at; whether a device sends is seen below")
    if is_network(path):
        return Check(path, "an address in the network; whether a device answers is seen below")
    return _chip(path) if path.startswith(GPIO_PREFIX) else _file(path)


def _chip(path: str) -> Check:
    try:
        return Check(path, f"there, it is {find_chip(path.removeprefix(GPIO_PREFIX))}")
    except DeviceError as error:
        return Check(path, ABSENT if "found the chips" in str(error) else str(error), f"{error}")


def _file(path: str) -> Check:
    """A mock's socket, an I2C adapter or a serial port."""
    file = Path(path.removeprefix(MOCK_PREFIX))
    if not file.exists():
        return Check(path, ABSENT, _absent(path))
    if not os.access(file, os.R_OK | os.W_OK):
        group = _group(file)
        return Check(path, f"not allowed, it belongs to group {group}", f"sudo usermod -aG {group} $USER, log in again")
    if path.startswith(MOCK_PREFIX):
        return Check(path, "socket of the mock")
    if is_mounted(file):
        return Check(path, "bus of a mock")
    if not stat.S_ISCHR(file.stat().st_mode):
        return Check(path, "no device file", "check the port in the vehicle file")
    return Check(path, f"there{_speed(file)}" if file.resolve() == file else f"there, it is {file.resolve()}")


def _absent(path: str) -> str:
    if path.startswith(MOCK_PREFIX):
        return "start the mock with ./hindrax mock"
    if path.startswith("/dev/i2c"):
        return "switch I2C on (raspi-config, or dtparam=i2c_arm=on in config.txt) and `sudo modprobe i2c-dev`"
    return "check cable and power; `sudo docker/pi/set-up.sh` installs the udev rules that make this name"


def _group(file: Path) -> str:
    with contextlib.suppress(KeyError):
        return grp.getgrgid(file.stat().st_gid).gr_name
    return str(file.stat().st_gid)


def _speed(file: Path) -> str:
    """Clock of an I2C adapter as the device tree sets it, where it does."""
    setting = Path("/sys/class/i2c-adapter") / file.name / "of_node/clock-frequency"
    with contextlib.suppress(OSError):
        return f", {int.from_bytes(setting.read_bytes()[:4], 'big') // 1000} kHz"
    return ""


def devices(settings: Settings, instead: Ports, clock: str) -> list[Check]:
    """Ask every sensor and the output for their identity, and sensors for their rate.

    Parameters
    ----------
    settings
        Vehicle and output.
    instead
        Ports in the place of those of the vehicle file, by name.
    clock
        system, or that of a mock.

    Returns
    -------
    list[Check]
        One for each.
    """
    vehicle, found = settings.vehicle, []
    output = instead.get("thrusters", settings.port)
    for name, mount in vehicle.sensors.items():
        where = output if name in vehicle.on_output_line else instead.get(name, mount.port)
        found.append(_asked(name, where, partial(_sensor, where, mount, vehicle, clock)))
    return [*found, _asked("thrusters", output, partial(_output, settings, output, clock))]


def _asked(name: str, where: str, ask: Callable[[], str]) -> Check:
    """Ask a device; an error becomes a failed check."""
    if (
        not is_network(where)
        and not where.startswith(GPIO_PREFIX)
        and not Path(where.removeprefix(MOCK_PREFIX)).exists()
    ):
        return Check(name, "not asked: no port", f"see {where}")
    try:
        return Check(name, f"{ask()} at {where}")
    except HindraxError as error:
        return Check(name, str(error), "check power, wiring, and port and address in the vehicle file")


def _sensor(where: str, mount: Mount, vehicle: Vehicle, clock_port: str) -> str:
    row = driver_of(mount.device)
    device = row.make(replace(row.knobs(), **row.looking), mount, vehicle)
    if not row.serial:
        captured = capture(where, device, RATE_S, lambda _part: None)
        rate = f"{len({one.stamp for one in captured.readings}) / RATE_S:.0f} Hz"
        return "; ".join([f"{captured.identity}, {rate}", *captured.rejected])
    with contextlib.closing(open_clock(clock_port, "doctor")) as clock:
        return _serial(where, device, clock)


def _serial(path: str, device: SerialDevice, clock: Clock) -> str:
    """Read from a device until it identifies itself, then count its readings; what it wants to send is sent."""
    last: dict[type, Any] = {}  # the last output, or reading, of each kind
    started, readings, count = clock.now(), 0, 0
    end, outputs = after(started, ANSWER_S), list(device.start(started))
    with contextlib.closing(open_line(path, device.baud, clock)) as line:
        while True:
            for output in outputs:
                if isinstance(output, Send):
                    line.send(output)
                elif isinstance(output, Identity) and Identity not in last:
                    started, readings = clock.now(), 0
                    end = after(started, RATE_S)
                readings += isinstance(output, Stamped)
                last[type(output.reading if isinstance(output, Stamped) else output)] = output
            if (now := clock.now()) >= end:
                break
            line.wait(min(after(now, TURN_S), end))
            data, stamp = line.read()
            count += len(data)
            outputs = [*(device.feed(data, stamp) if data else ()), *device.tick(clock.now())]
    trouble = last[Trouble].text if Trouble in last else ""
    if Identity not in last:
        speed = at_baud(path, device.baud)
        foreign = trouble or f"{count} invalid bytes{speed}"
        raise DeviceError(f"{path}: {foreign if count else f'silence{speed}'}")
    rate = readings / max(TURN_S, seconds_between(started, clock.now()))
    supply = f", supply {last[SonarHealth].reading.supply_V:.2f} V" if SonarHealth in last else ""
    return "; ".join(filter(None, (f"{last[Identity].text}, {rate:.0f} readings/s{supply}", trouble)))


def _output(settings: Settings, where: str, clock: str) -> str:
    vehicle, neutral = settings.vehicle, settings.guard.neutral
    output = open_output(vehicle, where, clock, lambda _stamp, _sent, _data: None, "doctor", neutral=neutral)
    with contextlib.closing(output):
        return set_up_patiently(output)
