"""Replays a recorded run without ROS: wire frames pass the real devices, navigator and identification.

Recorded wrenches pass the real guard and allocation. All recorded outputs are compared with the replayed ones. A bag
without wire frames is replayed from its messages; then the devices are not compared.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from hindrax_bag.message_comparison import ComparisonReport, Rules, load_rules
from hindrax_bag.read.bag_reader import BagMessage, attached_vehicle, attachments, messages
from hindrax_core.vehicle import Vehicle
from hindrax_replay import allocation_stage, state_stage
from hindrax_replay.allocation_stage import AllocationStage
from hindrax_replay.pipelined_stages import SecondStage, SettledMessage, hardly_collecting
from hindrax_replay.recorded_devices import Parameters, parameters_of
from hindrax_replay.state_stage import StateStage
from hindrax_replay.wire_stage import Samples, WireStage

FOLLOWED = frozenset(state_stage.INPUTS | allocation_stage.INPUTS)
"""Topics that the first stage forwards to the others."""


@dataclass(slots=True)
class Replayed:
    """Outcome of one replay."""

    bag: Path
    ledger: ComparisonReport
    begin: int = 0
    vehicle_s: float = 0.0
    wall_s: float = 0.0
    samples: Samples = field(default_factory=dict)

    def document(self) -> dict[str, Any]:
        """As it appears in JSON."""
        differences = [one.document(self.begin) for one in self.ledger.differences()]
        return {
            "bag": str(self.bag),
            "fields_compared": self.ledger.fields_compared,
            "differences": differences,
            "explained": self.ledger.explanations(),
        }


def replay(
    bag: Path,
    rules: Rules | None = None,
    vehicle: Vehicle | None = None,
    *,
    results: bool = False,
    names: Mapping[str, str] | None = None,
) -> Replayed:
    """Replay a bag and compare; `results`: also finish the identification, for a reference.

    `names`: our topic by the bag's topic, for third-party bags.

    UsageError when it is no bag, or has no vehicle file inside and none is given.
    """
    start = time.perf_counter()
    inside = attachments(bag)
    parameters = parameters_of(inside.get("parameters.yaml", b"").decode("utf-8", "replace"))
    vehicle = vehicle or attached_vehicle(bag, inside)
    done = Replayed(bag, ComparisonReport(rules or load_rules()))
    record = partial(renamed, bag, names or {})

    def follow(settled: Iterator[SettledMessage]) -> tuple[ComparisonReport, Samples]:
        return _second_stage(settled, vehicle, parameters, done.ledger, results=results)

    with hardly_collecting(), SecondStage((one for one in record() if one.topic in FOLLOWED), follow) as second:
        first = WireStage(vehicle, parameters, done.ledger, done.samples, second.forward, followed=FOLLOWED)
        for message in record():
            first.feed(message)
        first.finish()
        ledger, samples = second.result()
    done.ledger.add(ledger)
    done.samples |= samples
    done.begin, done.vehicle_s = first.begin, first.seconds
    done.wall_s = time.perf_counter() - start
    return done


def _second_stage(
    settled: Iterator[SettledMessage],
    vehicle: Vehicle,
    parameters: Parameters,
    ledger: ComparisonReport,
    *,
    results: bool,
) -> tuple[ComparisonReport, Samples]:
    samples: Samples = {}
    state = StateStage(vehicle, parameters, ledger, samples)
    allocation = AllocationStage(vehicle, parameters, ledger, samples)
    for message, replaced in settled:
        if message.topic in state_stage.INPUTS:
            state.feed(message, replaced)
        if message.topic in allocation_stage.INPUTS:
            allocation.feed(message)
    state.finish()
    allocation.finish()
    if results:
        state.keep_results()
    return ledger, samples


def renamed(bag: Path, names: Mapping[str, str]) -> Iterator[BagMessage]:
    """Messages of a bag, some topics under other names."""
    if not names:
        return messages(bag)
    return (one._replace(topic=names[one.topic]) if one.topic in names else one for one in messages(bag))
