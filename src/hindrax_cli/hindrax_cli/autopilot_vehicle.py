"""A vehicle file flown by an autopilot at an address: what it measures, and nothing that is not on its line."""

import atexit
import shutil
import tempfile
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

import yaml

from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.events import after
from hindrax_core.text.yaml_text import read_yaml
from hindrax_core.vehicle import OF_OUTPUT, load_vehicle

DEVICE = "ardusub"
PATIENCE_S, TURN_S = 15.0, 0.05
NAMES = ("autopilot", "estimator")
"""Of sensors that the file does not name; not every autopilot has a rangefinder."""
ADDRESSES = ("udpin:", "udpout:", "tcp:", "/dev/")
HELP = "fly an ArduSub there: udpin:0.0.0.0:14550, udpout:HOST:PORT, tcp:HOST:PORT or a port; only its own sensors"


def is_address(text: str) -> bool:
    """Whether a text is the address of an autopilot, and no file."""
    return text.startswith(ADDRESSES)


def asked_parameters(address: str, wanted: Sequence[str]) -> dict[str, float]:
    """Those parameters that the ArduSub at an address has, asked by name; nothing is written, nothing moves.

    HindraxError where none answers, and without the drivers, as in the wheel; DeviceError where the address cannot be
    opened.
    """
    try:
        from hindrax_drivers.buses.clock import SystemClock  # noqa: PLC0415  # the wheel has no drivers
        from hindrax_drivers.buses.line import open_line  # noqa: PLC0415  # as above
        from hindrax_drivers.devices.ardupilot.link import BAUD, Link  # noqa: PLC0415  # as above
    except ImportError as error:
        raise HindraxError(
            f"{address}: to ask an autopilot needs the drivers of a clone of hindrax; give a log of it: --from dive.bin"
        ) from error
    link = Link(wanted, {})
    with closing(SystemClock()) as clock, closing(open_line(address, BAUD, clock)) as line:
        until = after(clock.now(), PATIENCE_S)
        while (now := clock.now()) < until and (not link.system or link.asking):
            for order in link.tick(now):
                line.send(order)
            line.wait(after(now, TURN_S))
            data, stamp = line.read()
            for _ in link.feed(data, stamp):
                """Telemetry: what was asked is in the link."""
    if not link.system or link.asking:
        who = (link.foreign and "an autopilot that is no ArduPilot") or "no heartbeat of an ArduPilot"
        found = f"some parameters in {PATIENCE_S:g} s, not all" if link.system else who
        raise HindraxError(
            f"{address}: found {found}, wanted an ArduSub that answers; in BlueOS add a MAVLink endpoint that sends "
            "here (Vehicle, MAVLink Endpoints)"
        )
    return link.parameters


def behind_autopilot(file: Path, address: str) -> tuple[Path, tuple[str, ...]]:
    """A copy of a vehicle file behind an ArduSub at an address, and the names of the sensors that were left out.

    The copy has the way of driving of the file. In the place of its DVL comes the autopilot's estimator: where there is
    none, as on most BlueROV2, an unaided estimator has no velocity either. UsageError for what is no address.
    """
    if not is_address(address):
        wanted = "udpin:0.0.0.0:14550, udpout:192.168.2.2:14550, tcp:127.0.0.1:5760 or /dev/ttyACM0"
        raise UsageError(f"--autopilot: found {address!r}, wanted an address such as {wanted}")
    has_velocity = bool(load_vehicle(file).measuring("velocity"))
    data: dict[str, Any] = read_yaml(file.read_text(encoding="utf-8"), f"vehicle file {file}")
    before, output = data.get("sensors") or {}, data.get("output") or {}
    kinds = OF_OUTPUT[DEVICE]
    own = {name: {**one, "port": ""} for name, one in before.items() if one["device"] in kinds}
    have = {one["device"] for one in own.values()}
    wanted_kinds = zip(NAMES[: 1 + has_velocity], kinds, strict=False)
    own |= {name: {"device": kind} for name, kind in wanted_kinds if kind not in have}
    data["sensors"] = own
    data["output"] = {
        "device": DEVICE,
        "port": address,
        "control": output.get("control", "manual_control"),
        "light_channels": [],
    }
    copy = Path(tempfile.mkdtemp(prefix="hindrax-")) / file.name
    # The processes of the stack read it whenever one is started again, so it stays as long as this program.
    atexit.register(shutil.rmtree, copy.parent, ignore_errors=True)
    copy.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    load_vehicle(copy)
    return copy, tuple(name for name in before if name not in own)
