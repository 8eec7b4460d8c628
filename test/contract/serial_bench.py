"""A serial driver and an emulator on one line, in lock-step: the port, the clock and the operator of the sweep."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from hindrax_core.driver_interface import Identity, Output, Send, Trouble
from hindrax_core.events import Rejected, Stamped, stamp_from_s
from hindrax_drivers.devices.dvl75 import Dvl75
from hindrax_drivers.devices.ping1d import Ping1d
from hindrax_sim.devices.dvl75_sentences import DvlTruth
from hindrax_sim.faults.fault_registry import FaultSpec, with_faults
from hindrax_sim.faults.stream_faults import FaultyLine

STEP_S = 0.005
EPOCH_S = 1000.0
"""ROS time at the world's time zero."""


@dataclass
class Log:
    """What came out of the driver, each with the world's time at which it did."""

    readings: list[tuple[float, Stamped]] = field(default_factory=list)
    rejected: list[tuple[float, Rejected]] = field(default_factory=list)
    troubles: list[tuple[float, Trouble]] = field(default_factory=list)
    identities: list[tuple[float, Identity]] = field(default_factory=list)
    sends: list[tuple[float, Send]] = field(default_factory=list)

    def of(self, kind: type, since_s: float = 0.0, until_s: float = 1e9) -> list[Stamped]:
        found = self.readings
        return [one for at, one in found if since_s <= at < until_s and isinstance(one.reading, kind)]

    def reasons(self) -> set[str]:
        return {one.reason for _, one in self.rejected}


class Bench:
    """`truth(now_s)` is told to the emulator at every step."""

    def __init__(
        self,
        driver: Dvl75 | Ping1d,
        emulator: Any,
        truth: Callable[[float], DvlTruth],
        *,
        faults: list[FaultSpec] | None = None,
        seed: int = 1,
    ) -> None:
        self.driver = driver
        self.emulator = emulator
        name = faults[0].devices[0] if faults else ""
        self.line = with_faults(name, emulator, faults or [], seed)
        self.truth = truth
        self.now_s = 0.0
        self.log = Log()
        self._plugged = False

    def run(self, seconds: float) -> Log:
        for _ in range(round(seconds / STEP_S)):
            self.now_s += STEP_S
            self._step()
        return self.log

    def _step(self) -> None:
        self.line.set_truth(self.truth(self.now_s))
        faulty = isinstance(self.line, FaultyLine)
        arrived = self.line.chunks(self.now_s) if faulty else [self.line.step(self.now_s)]
        stamp = stamp_from_s(EPOCH_S + self.now_s)
        if faulty and not self.line.connected:
            self._plugged = False
            return
        if not self._plugged:
            # As a node does: the port is open (again), so the driver begins.
            self._plugged = True
            self._handle(self.driver.start(stamp))
        for chunk in arrived:
            if chunk:
                self._handle(self.driver.feed(chunk, stamp))
        self._handle(self.driver.tick(stamp))

    def _handle(self, outputs: list[Output]) -> None:
        kinds = {Rejected: "rejected", Trouble: "troubles", Identity: "identities", Stamped: "readings", Send: "sends"}
        for one in outputs:
            getattr(self.log, kinds[type(one)]).append((self.now_s, one))
            if isinstance(one, Send):
                self._answer(one)

    def _answer(self, send: Send) -> None:
        answer = self.line.receive((b"U" if send.wake else b"") + send.data, self.now_s)
        if answer:
            self._handle(self.driver.feed(answer, stamp_from_s(EPOCH_S + self.now_s)))


def world_s(stamped: Stamped) -> float:
    """Time of validity of a reading in the world's time."""
    return stamped.stamp * 1e-9 - EPOCH_S
