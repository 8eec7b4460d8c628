"""Settings shared by the launch files, without launch itself: ports of simulated hardware, environment of the graph."""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import IO, Any

import yaml

from hindrax_bringup.stack import environment, mock_parameters
from hindrax_bringup.stack_lock import LAUNCHED, StackLock, graph_settings, locked, runtime_folder
from hindrax_bringup.tether import FOREVER_S, tether_setting, wait_for_address
from hindrax_core.vehicle import load_vehicle
from hindrax_drivers.driver_registry import DEVICES

_announced: list[IO[str]] = []
"""Locked for as long as `ros2 launch` lives."""


def announce(context: Any, *, mock: bool, made: Sequence[tuple[str, str]], vehicle: str = "") -> None:
    """Let commands in other terminals find the stack that this launch starts, in the graph of its settings `made`.

    `context` is launch's own; `vehicle`: the file where no argument of launch names it.
    """
    chosen = context.launch_configurations
    graph, record = graph_settings(os.environ | dict(made)), str(chosen.get("record", ""))
    presence = StackLock(
        os.getpid(), mock, str(chosen.get("vehicle", vehicle)), record, graph, purpose=LAUNCHED, bag=record
    )
    _announced.append(locked(runtime_folder() / f"{os.getpid()}.json", asdict(presence)))


def ports(folder: Path, vehicle_file: Path) -> dict[str, object]:
    """Ports of simulated hardware in a folder: serial devices as ptys, everything else on its bus."""
    bus = f"mock:{folder / 'i2c'}"
    sensors = load_vehicle(vehicle_file).sensors
    found = {name: str(folder / name) if DEVICES[one.device].serial else bus for name, one in sensors.items()}
    return {"ports": found | {"thrusters": bus}, "clock": bus}


def parameter_file(folder: Path, vehicle_file: Path) -> Path:
    """Write parameters that put every node on the simulated hardware of a folder and into its time."""
    own = mock_parameters(ports(folder, vehicle_file))
    blocks: Mapping[str, Mapping[str, object]] = {"/**": {"vehicle": str(vehicle_file), "use_sim_time": True}, **own}
    file = folder / "parameters.yaml"
    file.write_text(yaml.safe_dump({name: {"ros__parameters": dict(one)} for name, one in blocks.items()}))
    return file


def settings(*, mock: bool) -> list[tuple[str, str]]:
    """Environment variables of the nodes' graph that differ from this terminal's.

    Waits for a named tether: nodes that start before it is up never discover anybody there.
    """
    tether = None if mock else tether_setting()
    if tether is not None:
        wait_for_address(tether, FOREVER_S, lambda: False, lambda sentence: print(sentence, file=sys.stderr))
    made = environment(mock=mock, domain=None, tether=tether)
    return [(key, value) for key, value in made.items() if os.environ.get(key) != value]
