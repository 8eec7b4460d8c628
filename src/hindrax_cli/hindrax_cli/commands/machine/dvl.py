"""`hindrax dvl`: what the DVL keeps in its flash, shown and set. Nothing else in the stack changes these settings."""

import argparse
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from typing import Any

from hindrax_analysis.terminal import print_answer
from hindrax_cli.argument_types import add_json, add_sensor, add_vehicle, within
from hindrax_cli.command import command, option
from hindrax_core.driver_interface import Identity, Send
from hindrax_core.errors import HindraxError
from hindrax_core.events import after
from hindrax_core.hydrostatics import Water
from hindrax_core.text.screen_text import print_stderr
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.bus_capture import mount_of
from hindrax_drivers.buses.clock import Clock, SystemClock
from hindrax_drivers.buses.line import at_baud, open_line
from hindrax_drivers.devices import dvl75_settings as flash
from hindrax_drivers.devices.dvl75 import Dvl75

ANSWER_S = 2.0
FLASH_S = 0.5
"""Time given to the device after a command, which it writes to flash."""
SWITCHES = {"--pool-mode": flash.POOL_MODE, "--retweet-gps": "Retweet GPS", "--kalman": "DVKFA messages"}
ANGLE, BAUD = within(float, -360.0, 360.0), within(int, 9600, 921600)
ANGLES = {"--heading-offset": flash.HEADING_OFFSET, "--declination": "Magnetic declination"}


@command(
    "./hindrax dvl setup --pool-mode on --dry-run",
    option("action", choices=("show", "setup"), help="show the settings, or set those that differ"),
    add_vehicle,
    add_sensor,
    option("--port", metavar="PATH", help="serial port, or udp://ADDRESS:PORT; default: of the vehicle file"),
    option(
        "--speed-of-sound",
        type=within(float, 1100.0, 1950.0),
        metavar="M_PER_S",
        help="wanted [m/s]; default: of the vehicle file's water",
    ),
    option("--velocity-adjustment", type=within(float, 0.8, 1.25), default=1.0, metavar="FACTOR", help="wanted [-]"),
    option(
        "--orientation",
        type=ANGLE,
        nargs=3,
        metavar=("ROLL", "PITCH", "YAW"),
        help="how the sensor head is mounted in the vehicle [deg]",
    ),
    *(option(name, type=ANGLE, metavar="DEG", help="added to the device's compass [deg, to 0.1]") for name in ANGLES),
    option("--pool-mode", choices=("on", "off"), help="for small tanks, whose walls echo"),
    option("--retweet-gps", choices=("on", "off"), help="forward the sentences of a GPS at the DVL"),
    option("--kalman", choices=("on", "off"), help="send $DVKFA, for your own Kalman filter"),
    option("--imu-calibration", choices=tuple(flash.IMU_CALIBRATION), help="store or delete the current one"),
    option("--baud", type=BAUD, default=flash.Dvl75Knobs().baud, metavar="RATE", help="current line speed [bit/s]"),
    option("--baud-rate", type=BAUD, metavar="RATE", help="new line speed [bit/s]"),
    option("--reboot", action="store_true", help="restart the device afterwards"),
    option("--always", action="store_true", help="also send unchanged settings; wears the flash"),
    option("--dry-run", action="store_true", help="only print the commands, send nothing"),
    add_json,
)
def dvl(arguments: argparse.Namespace) -> int:
    """Show or set the settings in the flash of the DVL."""
    vehicle = load_vehicle(arguments.vehicle)
    port = arguments.port or mount_of(vehicle, Dvl75, arguments.sensor)[1].port
    knobs = replace(
        flash.Dvl75Knobs(),
        baud=arguments.baud,
        speed_of_sound_mps=arguments.speed_of_sound,
        velocity_adjustment=arguments.velocity_adjustment,
        enable_tries=0,
    )
    calibrate = [flash.IMU_CALIBRATION[arguments.imu_calibration]] if arguments.imu_calibration else []
    named, last = asked(arguments), [flash.REBOOT] if arguments.reboot else []
    with closing(SystemClock()) as clock, closing(DvlConversation(port, knobs, vehicle.water, clock)) as talk:
        if arguments.action == "show":
            report = talk.show()
        else:
            report = talk.set_up(calibrate, named, last, always=arguments.always, dry_run=arguments.dry_run)
    return print_answer(report, "\n".join(lines(report)), as_json=arguments.json)


def asked(arguments: argparse.Namespace) -> dict[str, str]:
    """Settings that were named, as $DVNVM reports them; the line speed last, for it cuts the line."""
    named = vars(arguments)
    found = {}
    for word, key in SWITCHES.items():
        if value := named[word[2:].replace("-", "_")]:
            found[key] = value.upper()
    for word, key in ANGLES.items():
        if (value := named[word[2:].replace("-", "_")]) is not None:
            found[key] = f"{value:.1f}"
    if arguments.orientation is not None:
        found["Sensor Orientation"] = ",".join(f"{angle:g}" for angle in arguments.orientation)
    if arguments.baud_rate is not None:
        found[flash.BAUD_RATE] = str(arguments.baud_rate)
    return found


class DvlConversation:
    """One conversation with a DVL over its port."""

    def __init__(self, path: str, knobs: flash.Dvl75Knobs, water: Water, clock: Clock) -> None:
        self._path, self._knobs, self._water, self._clock = path, knobs, water, clock
        self._device = Dvl75(knobs, water)
        self._port = open_line(path, self._device.baud, clock)
        self._identity = ""

    def close(self) -> None:
        """Give the port back."""
        self._port.close()

    def show(self) -> dict[str, object]:
        """Identity and settings, as far as the device reports them."""
        settings = self._ask()
        return {"port": self._path, "identity": self._identity, "settings": settings}

    def set_up(
        self, before: Sequence[bytes], named: Mapping[str, str], last: Sequence[bytes], *, always: bool, dry_run: bool
    ) -> dict[str, object]:
        """Send what differs (or everything), then query again and report what still differs.

        What the device does not report cannot be verified, and the report marks it.

        Parameters
        ----------
        before, last
            Orders around the settings.
        named
            Settings that were asked for.
        always
            Whether to send also what the device reports as it is wanted.
        dry_run
            Whether to send nothing but the query.

        Returns
        -------
        dict[str, object]
            Port, identity, orders; `sent`, and once they were, `verified`, `unverified` and `settings`.

        Raises
        ------
        HindraxError
            For settings that it reports otherwise afterwards.
        """
        current = self._ask()
        wanted = {**flash.wanted_settings(self._knobs, current["Model"], self._water), **named}
        first = [*before, *flash.commands(current, wanted, always)]
        report: dict[str, object] = {"port": self._path, "identity": self._identity}
        report["orders"] = _texts([*first, *last])
        if dry_run:
            return report | {"sent": False}
        for order in first:
            self._send(order)
        settings = self._ask()
        reported = {key: value for key, value in wanted.items() if key in settings}
        if left := flash.commands(settings, reported):
            raise HindraxError(f"{self._path}: DVL did not accept {', '.join(_texts(left))}; check its firmware")
        for order in last:
            self._send(order)
        unverified = [key for key in wanted if key not in reported]
        return report | {"sent": True, "verified": not unverified, "unverified": unverified, "settings": settings}

    def _send(self, order: bytes) -> None:
        print_stderr(f"sending {order.decode().strip()}")
        self._port.send(Send(order))
        self._listen(FLASH_S)
        word, _, speed = order.decode().strip().partition(" ")
        if word == "BAUD-RATE":
            self._knobs = replace(self._knobs, baud=int(speed))
            self._port.close()
            self._port = open_line(self._path, int(speed), self._clock)

    def _ask(self) -> dict[str, str]:
        """Ask for the configuration; without a report there is only the model, by the sentences that it sends."""
        self._device, self._identity = Dvl75(self._knobs), ""
        for output in self._device.start(self._clock.now()):
            if isinstance(output, Send):
                self._port.send(output)
        received = self._listen(ANSWER_S, until_configured=True)
        if not self._identity:
            found, speed = "other bytes" if received else "silence", at_baud(self._path, self._device.baud)
            remedy = "check power, cable and speed" if speed else "check power, cable and where the DVL sends to"
            raise HindraxError(f"{self._path}: found {found}, wanted a DVL{speed}; {remedy}")
        return {"Model": "DVL-75" if "DVL-75" in self._identity else ""} | dict(self._device.configuration)

    def _listen(self, seconds: float, *, until_configured: bool = False) -> int:
        """Hear the device out; returns the number of bytes."""
        end, count = after(self._clock.now(), seconds), 0
        while self._clock.now() < end and not (until_configured and self._device.configuration):
            self._port.wait(end)
            data, stamp = self._port.read()
            count += len(data)
            for output in self._device.feed(data, stamp):
                if isinstance(output, Identity):
                    self._identity = output.text
        return count


def _texts(orders: Iterable[bytes]) -> list[str]:
    return [order.decode("ascii").strip() for order in orders]


def lines(report: Mapping[str, Any]) -> list[str]:
    """Return the report as lines of text."""
    found = [f"{report['identity']} on {report['port']}"]
    if "settings" in report:
        found += [f"  {key}: {value}" for key, value in report["settings"].items()] or ["  settings: not reported"]
    if "orders" in report:
        verb = "sent" if report["sent"] else "would send"
        found += [f"{verb}: {order}" for order in report["orders"]] or ["nothing to change"]
    if report.get("sent") and report["unverified"]:
        found.append(f"not reported by the device, and so not verified: {', '.join(report['unverified'])}")
    return found
