"""A Blue Robotics SOS leak sensor on a line with a pull-up: low while it has power and its probes are dry."""

from hindrax_core.readings import Leak
from hindrax_sim.devices.emulator import Emulator, Part

UNPOWERED_S = 0.15


class SosLeak(Part[Leak]):
    """One board with its probes. Disguised, it is another signal on the line."""

    def __init__(self, _seed: int = 0) -> None:
        super().__init__(Leak(wet=False))
        self._turn = 0
        self._powered_s = 0.0

    def write(self, data: bytes, now_s: float) -> None:
        """The bias of the line, which the board is stronger than."""

    def read(self, count: int, now_s: float) -> bytes:
        """The level; the pull-up's alone while the board has no power."""
        self._turn += 1
        wet = self._truth.wet or now_s < self._powered_s
        return bytes([self._turn // 2 % 2 if self._disguised else wet])[:count]

    def power_cycle(self, now_s: float) -> None:
        """Fault: the board is without power for a moment."""
        self._powered_s = now_s + UNPOWERED_S


EMULATOR = Emulator(
    make=SosLeak,
    address=27,  # ArduSub, parameter LEAK1_PIN of a Navigator
    truth=lambda world, _at: Leak(world.water_in_hull),
    example=lambda seconds: Leak(wet=seconds >= 30.0),
    agrees=lambda truth, reading: bool(truth.wet == reading.wet),
)
