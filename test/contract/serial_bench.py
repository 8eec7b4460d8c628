"""A serial driver and an emulator on one line, in lock-step: the port, the clock and the operator of the sweep."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

from hindrax_core.driver_interface import Identity, Output, Send, SerialDevice, Trouble
from hindrax_core.events import Rejected, Stamp, Stamped, stamp_from_s
from hindrax_core.readings import Reading
from hindrax_sim.faults.fault_registry import FaultSpec, with_faults
from hindrax_sim.faults.stream_faults import FaultyLine

DriverT = TypeVar("DriverT", bound=SerialDevice)
ReadingT = TypeVar("ReadingT")
STEP_S = 0.005
EPOCH_S = 1000.0
"""ROS time at the world's time zero."""


@dataclass
class Log:
    """What came out of the driver, each with the world's time at which it did."""

    readings: list[tuple[float, Stamped[Reading]]] = field(default_factory=list)
    rejected: list[tuple[float, Rejected]] = field(default_factory=list)
    troubles: list[tuple[float, Trouble]] = field(default_factory=list)
    identities: list[tuple[float, Identity]] = field(default_factory=list)
    sends: list[tuple[float, Send]] = field(default_factory=list)

    def of(self, kind: type[ReadingT], since_s: float = 0.0, until_s: float = 1e9) -> list[Stamped[ReadingT]]:
        found = [(one.stamp, one.reading) for at, one in self.readings if since_s <= at < until_s]
        return [Stamped(stamp, reading) for stamp, reading in found if isinstance(reading, kind)]

    def reasons(self) -> set[str]:
        return {one.reason for _, one in self.rejected}


class Bench(Generic[DriverT]):
    """`truth(now_s)` is told to the emulator at every step."""

    def __init__(
        self,
        driver: DriverT,
        emulator: Any,
        truth: Callable[[float], object],
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
        line = self.line
        self.emulator.set_truth(self.truth(self.now_s), self.now_s)
        arrived = line.chunks(self.now_s) if isinstance(line, FaultyLine) else [line.step(self.now_s)]
        stamp = stamp_from_s(EPOCH_S + self.now_s)
        if isinstance(line, FaultyLine) and not line.connected:
            self._plugged = False
            return
        if not self._plugged:
            # As a node does: the port is open (again), so the driver begins.
            self._plugged = True
            self._handle(self.driver.start(stamp))
        for chunk in arrived:
            if chunk:
                self._feed(chunk, stamp)
        self._handle(self.driver.tick(stamp))

    def _feed(self, data: bytes, stamp: Stamp) -> None:
        self._handle(self.driver.feed(data, stamp))

    def _handle(self, outputs: Iterable[Output]) -> None:
        kinds = {Rejected: "rejected", Trouble: "troubles", Identity: "identities", Stamped: "readings", Send: "sends"}
        for one in outputs:
            getattr(self.log, kinds[type(one)]).append((self.now_s, one))
            if isinstance(one, Send):
                self._answer(one)

    def _answer(self, send: Send) -> None:
        answer = self.line.receive((b"U" if send.wake else b"") + send.data, self.now_s)
        if answer:
            self._feed(answer, stamp_from_s(EPOCH_S + self.now_s))


def world_s(stamped: Stamped[Any]) -> float:
    """Time of validity of a reading in the world's time."""
    return stamped.stamp * 1e-9 - EPOCH_S
