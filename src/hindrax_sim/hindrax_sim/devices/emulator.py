"""What an emulator file offers under the name EMULATOR, and the base class of the parts that measure."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from hindrax_core.vehicle import Mount
from hindrax_sim.world import Mounting, World

TruthT = TypeVar("TruthT")


@dataclass(frozen=True, slots=True)
class Emulator:
    """`make(seed)` gives the part, `truth(world, mounting)` what is true at its place in the mock world.

    The contract sweep uses the other two: `example(seconds)` is a truth that moves as a vehicle might, and
    `agrees(truth, reading)` says whether a reading may be said of a truth, by the accuracy of the data sheet.
    """

    make: Callable[[int], Any]
    truth: Callable[[World, Mounting], Any]
    example: Callable[[float], Any]
    agrees: Callable[[Any, Any], bool]
    address: int = 0
    """Its I2C address where the vehicle file gives none; 0 for a part on a serial line."""
    also_at: Callable[[Any, Mount], dict[int, Any]] = lambda _part, _mount: {}
    """Further addresses on the bus that the same part answers at, as it is mounted."""


class Part(Generic[TruthT]):
    """An emulated part: what is true at its place, and the faults that it may have. What they do, its class says."""

    def __init__(self, truth: TruthT) -> None:
        self._truth = truth
        self._disguised = self._saturated = self._hung = False

    def set_truth(self, truth: TruthT, _now_s: float) -> None:
        """Set the truth from now on."""
        self._truth = truth

    def power_cycle(self, now_s: float) -> None:
        """Fault, and power-up: power is lost and comes back at once."""
        raise NotImplementedError

    def jump_clock(self, seconds: float) -> None:
        """Fault: the part's clock jumps; no effect on a part without one."""

    def disguise(self, on: bool) -> None:
        """Fault: another part answers in its place."""
        self._disguised = on

    def saturate(self, on: bool) -> None:
        """Fault: measurements are at the end of their scale, well framed and confident."""
        self._saturated = on

    def hang(self, on: bool) -> None:
        """Fault: the converters repeat the last values."""
        self._hung = on
