"""A vehicle file flown by an autopilot at an address: what it measures, and nothing that is not on its line."""

import tempfile
from pathlib import Path
from typing import Any

import yaml

from hindrax_core.errors import UsageError
from hindrax_core.text.yaml_text import read_yaml
from hindrax_core.vehicle import OF_OUTPUT, load_vehicle
from hindrax_drivers.buses.line import TCP_PREFIX, UDP_IN, UDP_OUT

DEVICE = "ardusub"
NAMES = ("autopilot", "estimator")
"""Of sensors that the file does not name; not every autopilot has a rangefinder."""
ADDRESSES = (UDP_IN, UDP_OUT, TCP_PREFIX, "/dev/")
HELP = "fly an ArduSub there: udpin:0.0.0.0:14550, udpout:HOST:PORT, tcp:HOST:PORT or a port; only its own sensors"


def behind_autopilot(file: Path, address: str) -> tuple[Path, tuple[str, ...]]:
    """A copy of a vehicle file behind an ArduSub at an address, and the names of the sensors that were left out.

    The copy has the way of driving of the file. In the place of its DVL comes the autopilot's estimator: where there is
    none, as on most BlueROV2, an unaided estimator has no velocity either. UsageError for what is no address.
    """
    if not address.startswith(ADDRESSES):
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
    copy.write_text(yaml.safe_dump(data, sort_keys=False), encoding="utf-8")
    load_vehicle(copy)
    return copy, tuple(name for name in before if name not in own)
