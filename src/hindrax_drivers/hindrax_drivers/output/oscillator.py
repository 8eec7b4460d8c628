"""Measure the oscillator of a PCA9685 by its own pulses on a spare channel, wired back to a GPIO. Pure.

The period of a pulse is 4096 * (PRE_SCALE + 1) cycles (NXP PCA9685 rev. 4, section 7.3.5), and the kernel counts and
stamps the edges by the crystal of the computer, which is hundreds of times more exact than the oscillator.
"""

from collections.abc import Sequence
from itertools import pairwise

from hindrax_core.bus_operations import EDGE, EDGES, DeviceError, Pause, Program, Read, Write, WriteRead
from hindrax_drivers.devices.pca9685 import FULL_OFF, LED0, MODE1, PRE_SCALE, SLEEP, STEPS

HALF = STEPS // 2
LOOKS = 50
FEWEST_SAMPLES = 100
IRREGULAR = 0.05
"""Largest distance of an interval from a whole number of periods, in periods; a busy kernel is a tenth of that late."""
PLAUSIBLE_Hz = (20e6, 50e6)

Edge = tuple[int, int]
"""Number of an edge on its line, and its time [ns]."""


def look(address: int, chip: str, line: int) -> Program[None]:
    """Find chip and GPIO line, and change nothing. DeviceError where one of them is missing.

    Parameters
    ----------
    address, chip, line
        Of the PCA9685, and of the line that sees its pulses.

    Yields
    ------
    Transaction | Pause
        What it wants from the bus.
    """
    yield WriteRead(address, bytes([MODE1]), 1)
    yield Write(EDGES + line, chip.encode())


def begin(address: int, channel: int) -> Program[int]:
    """Put pulses of half a period on a channel; returns PRE_SCALE. DeviceError where the chip sleeps."""
    mode = (yield WriteRead(address, bytes([MODE1]), 1))[0]
    if mode & SLEEP:
        raise DeviceError(f"pca9685 at {address:#04x}: is asleep, wanted it set up; check its supply")
    yield Write(address, _channel(channel, HALF))
    return (yield WriteRead(address, bytes([PRE_SCALE]), 1))[0]


def edges(chip: str, line: int, seconds: float) -> Program[Sequence[Edge]]:
    """Look for the newest rising edge of a line, 51 times over some seconds.

    Parameters
    ----------
    chip, line
        That sees the pulses.
    seconds : [s]
        Bus time.

    Yields
    ------
    Transaction | Pause
        What it wants from the bus; it returns the edges.
    """
    yield Write(EDGES + line, chip.encode())
    found = []
    for _ in range(LOOKS + 1):
        yield Pause(seconds / LOOKS)
        found.append(EDGE.unpack((yield Read(EDGES + line, EDGE.size))))
    return found


def end(address: int, channel: int) -> Program[None]:
    """Switch the channel off."""
    yield Write(address, _channel(channel, FULL_OFF))


def clock_Hz(found: Sequence[Edge], prescale: int) -> float:
    """Frequency of the oscillator [Hz]. DeviceError where there are too few edges, or edges of another signal."""
    count, elapsed_ns = found[-1][0] - found[0][0], found[-1][1] - found[0][1]
    if count < FEWEST_SAMPLES:
        raise DeviceError(f"found {count} edges, wanted at least {FEWEST_SAMPLES}; check wire, channel and GPIO line")
    steps = [(after[0] - before[0], after[1] - before[1]) for before, after in pairwise(found)]
    wrong = sum(abs(ns * count / max(1, elapsed_ns) - number) > IRREGULAR for number, ns in steps)
    if wrong:
        raise DeviceError(f"found {wrong} of {len(steps)} intervals irregular, wanted pulses; check the wire")
    found_Hz = STEPS * (prescale + 1) * count * 1e9 / max(1, elapsed_ns)
    if not PLAUSIBLE_Hz[0] <= found_Hz <= PLAUSIBLE_Hz[1]:
        raise DeviceError(f"found {found_Hz / 1e6:.3f} MHz, wanted 20 to 50 MHz; is another signal on the line?")
    return found_Hz


def _channel(channel: int, off: int) -> bytes:
    return bytes([LED0 + 4 * channel, 0, 0, *off.to_bytes(2, "little")])
