"""A recorded run again, without ROS: what passed the wires goes through devices, navigator and identification.

They are the real ones, and everything that was recorded of them is compared with what comes out. A bag without wire
frames is replayed from its messages: then only navigator and identification are compared.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import yaml

from hindrax_bag.compare import Ledger, Loader, Rules, load_rules
from hindrax_bag.reader import BagMessage, attachments, messages
from hindrax_bringup.both_stages import Follower, Heard, hardly_collecting
from hindrax_bringup.state_stage import HEARD, StateStage
from hindrax_bringup.wire_replay import Parameters, parameters_of
from hindrax_bringup.wire_stage import COMPARED, Samples, WireStage
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import Vehicle, parse_vehicle

FOLLOWED = HEARD & COMPARED
"""Topics of which the first stage tells the second."""


@dataclass(slots=True)
class Replayed:
    """What came of one replay."""

    bag: Path
    ledger: Ledger
    begin: int = 0
    vehicle_s: float = 0.0
    wall_s: float = 0.0
    samples: Samples = field(default_factory=dict)

    @property
    def times_real_time(self) -> float:
        """Speed of the replay."""
        return self.vehicle_s / self.wall_s if self.wall_s > 0.0 else 0.0

    def document(self) -> dict[str, Any]:
        """As it appears in JSON."""
        differences = [one.document(self.begin) for one in self.ledger.differences()]
        return {"bag": str(self.bag), "fields_compared": self.ledger.fields_compared, "differences": differences}


def replay(
    bag: Path,
    rules: Rules | None = None,
    vehicle: Vehicle | None = None,
    *,
    results: bool = False,
    names: Mapping[str, str] | None = None,
) -> Replayed:
    """Run a bag again and compare; with `results` the identification is also concluded, for a reference.

    `names` are those of our topics by those of the bag, for bags of others.

    UsageError when it is no bag, or has no vehicle file inside and none is given.
    """
    start = time.perf_counter()
    inside = attachments(bag)
    parameters = parameters_of(inside.get("parameters.yaml", b"").decode("utf-8", "replace"))
    vehicle = vehicle or _vehicle_of(bag, inside)
    done = Replayed(bag, Ledger(rules or load_rules()))
    record = partial(renamed, bag, names or {})

    def follow(heard: Iterator[Heard]) -> tuple[Ledger, Samples]:
        return _second_stage(heard, vehicle, parameters, done.ledger, results=results)

    with hardly_collecting(), Follower((one for one in record() if one.topic in FOLLOWED), follow) as second:
        first = WireStage(vehicle, parameters, done.ledger, done.samples, second.tell)
        for message in record():
            first.hear(message)
        first.finish()
        ledger, samples = second.result()
    done.ledger.add(ledger)
    done.samples |= samples
    done.begin, done.vehicle_s = first.begin, first.seconds
    done.wall_s = time.perf_counter() - start
    return done


def _second_stage(
    heard: Iterator[Heard], vehicle: Vehicle, parameters: Parameters, ledger: Ledger, *, results: bool
) -> tuple[Ledger, Samples]:
    samples: Samples = {}
    stage = StateStage(vehicle, parameters, ledger, samples)
    for message, instead in heard:
        stage.hear(message, instead)
    stage.finish()
    if results:
        stage.conclude()
    return ledger, samples


def renamed(bag: Path, names: Mapping[str, str]) -> Iterator[BagMessage]:
    """Messages of a bag, some topics under other names."""
    if not names:
        return messages(bag)
    return (one._replace(topic=names[one.topic]) if one.topic in names else one for one in messages(bag))


def _vehicle_of(bag: Path, inside: dict[str, bytes]) -> Vehicle:
    text = inside.get("vehicle.yaml")
    if text is None:
        raise UsageError(f"{bag}: has no vehicle file inside; name one with --vehicle")
    return parse_vehicle(yaml.load(text, Loader), f"{bag}, vehicle.yaml")  # noqa: S506  # a safe one
