"""`hindrax ping`: what the echo sounder measures, asked over its own port, with the stack down."""

import argparse
from collections.abc import Mapping
from contextlib import closing
from dataclasses import asdict
from typing import Any, TypeVar

from hindrax_analysis.plain import plain
from hindrax_analysis.terminal import print_answer
from hindrax_cli.argument_types import add_json, add_sensor, add_vehicle, within
from hindrax_cli.command import command, option
from hindrax_core.driver_interface import Identity, Send, Trouble
from hindrax_core.errors import HindraxError
from hindrax_core.events import Stamped, after
from hindrax_core.readings import EchoProfile, SonarHealth
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.bus_capture import mount_of
from hindrax_drivers.buses.clock import SystemClock
from hindrax_drivers.buses.line import SerialPort
from hindrax_drivers.devices.ping1d import Ping1d
from hindrax_drivers.devices.ping1d_settings import Ping1dKnobs
from hindrax_drivers.protocols import ping_protocol as protocol

PATIENCE_S = 8.0
TICK_S = 0.05
ROWS = 20
WIDTH = 50
LOUDEST = 255
ReadingT = TypeVar("ReadingT")


@command(
    "./hindrax ping profile --port /dev/hindrax/ping",
    option("action", choices=("profile", "show"), help="one profile, or the device itself"),
    add_vehicle,
    add_sensor,
    option("--port", metavar="PATH", help="serial port; default: of the vehicle file"),
    # 255 is everybody (ping-protocol, docs/index.md).
    option("--device-id", type=within(int, 0, 254), metavar="N", help="give the sonar this number first, 0 to 254"),
    add_json,
)
def ping(arguments: argparse.Namespace) -> int:
    """Query the sonar: one echo profile, or its number, supply and temperatures."""
    vehicle = load_vehicle(arguments.vehicle)
    port = arguments.port or mount_of(vehicle, Ping1d, arguments.sensor)[1].port
    knobs = Ping1dKnobs(continuous=False, profile=True, min_confidence=0.0)
    sonar, device_id = Ping1d(knobs, vehicle.water), arguments.device_id
    order = b"" if device_id is None else protocol.encode(protocol.SET_DEVICE_ID, bytes([device_id]))
    if arguments.action == "profile":
        identity, echo = ask(port, sonar, EchoProfile, order)
        found = document(port, identity, echo, sonar.round_trip_s or 0.0)
        return print_answer(found, "\n".join(drawn(found)), as_json=arguments.json)
    identity, health = ask(port, sonar, SonarHealth, order)
    report = {"port": port, "identity": identity} | {name: plain(value) for name, value in asdict(health).items()}
    lines = (f"{key}: {value}" for key, value in report.items())
    return print_answer(report, "\n".join(lines), as_json=arguments.json)


def ask(path: str, sonar: Ping1d, wanted: type[ReadingT], order: bytes = b"") -> tuple[str, ReadingT]:
    """Wake a sonar, give it an order, set it up, and wait for a reading.

    Parameters
    ----------
    path
        Of the port.
    sonar
        Driver with its knobs.
    wanted
        Kind of the reading.
    order
        Bytes sent as soon as it has told who it is.

    Returns
    -------
    tuple[str, ReadingT]
        Who it is, and the reading.

    Raises
    ------
    HindraxError
        When none comes in `PATIENCE_S`, with the last trouble.
    """
    identity, trouble = "", "silence"
    with closing(SystemClock()) as clock, closing(SerialPort(path, sonar.baud, clock)) as port:
        outputs: list[object] = list(sonar.start(clock.now()))
        end = after(clock.now(), PATIENCE_S)
        while clock.now() < end:
            for one in outputs:
                if isinstance(one, Send):
                    port.send(one)
                elif isinstance(one, Identity):
                    identity = one.text
                    port.send(Send(order))
                elif isinstance(one, Trouble):
                    trouble = one.text
                elif isinstance(one, Stamped) and isinstance(one.reading, wanted):
                    return identity, one.reading
            port.wait(after(clock.now(), TICK_S))
            data, stamp = port.read()
            outputs = [*sonar.feed(data, stamp), *sonar.tick(stamp)]
    raise HindraxError(f"{path}: no answer in {PATIENCE_S:g} s ({trouble}); check power, cable and speed")


def document(port: str, identity: str, echo: EchoProfile, round_trip_s: float) -> dict[str, object]:
    """Return the answer for a program.

    Parameters
    ----------
    port, identity
        Where, and who.
    echo
        Distance, confidence, and strengths from 0 to 255, evenly over the scan.
    round_trip_s : [s]
        From the request to the answer.

    Returns
    -------
    dict[str, object]
        For JSON.
    """
    return {
        "port": port,
        "identity": identity,
        "distance_m": echo.range_m,
        "confidence": echo.confidence,
        "scan_m": [echo.start_m, echo.start_m + echo.length_m],
        "gain": echo.gain,
        "round_trip_s": round_trip_s,
        "strength": list(echo.strength),
    }


def drawn(found: Mapping[str, Any]) -> list[str]:
    """Return the document as text: one row per part of the scan, as long as its loudest echo."""
    (start_m, end_m), strength, count = found["scan_m"], found["strength"], len(found["strength"])
    parts = [strength[count * row // ROWS : count * (row + 1) // ROWS] for row in range(ROWS)]
    return [
        f"{found['identity']} on {found['port']}, answered in {found['round_trip_s'] * 1e3:.0f} ms",
        f"{found['distance_m']:.3f} m, confidence {found['confidence']:.0%}, gain {found['gain']}",
        *(
            f"{start_m + (end_m - start_m) * (row + 0.5) / ROWS:7.2f} m  {'#' * (WIDTH * max(part) // LOUDEST)}"
            for row, part in enumerate(parts)
            if part
        ),
    ]
