"""Measure the oscillator of a PCA9685 by its own pulses on a spare channel, wired back to a GPIO. Pure.

The period of a pulse is 4096 * (PRE_SCALE + 1) cycles (NXP PCA9685 rev. 4, section 7.3.5), and the kernel stamps every
edge by the crystal of the computer, which is hundreds of times more exact than the oscillator.
"""

from __future__ import annotations

import statistics
from collections.abc import Sequence
from itertools import pairwise

from hindrax_core.bus_operations import DeviceError, Program, Write, WriteRead
from hindrax_drivers.devices.pca9685 import LED0, MODE1, OFF, PRE_SCALE, SLEEP, STEPS

HALF = STEPS // 2
FEWEST = 100
IRREGULAR = 0.05
"""Largest distance of an interval from a whole number of periods, in periods; a busy kernel is a tenth of that late."""
BELIEVABLE_Hz = (20e6, 50e6)


def begin(address: int, channel: int) -> Program[int]:
    """Put pulses of half a period on a channel; returns PRE_SCALE. DeviceError where the chip sleeps."""
    mode = (yield WriteRead(address, bytes([MODE1]), 1))[0]
    if mode & SLEEP:
        raise DeviceError(f"pca9685 at {address:#04x}: is asleep, wanted it set up; check its supply")
    yield Write(address, _channel(channel, HALF))
    return (yield WriteRead(address, bytes([PRE_SCALE]), 1))[0]


def end(address: int, channel: int) -> Program[None]:
    """Switch the channel off."""
    yield Write(address, _channel(channel, OFF))


def clock_Hz(edges_ns: Sequence[int], prescale: int) -> float:
    """Frequency of the oscillator [Hz] by the times of rising edges; lost edges do no harm.

    DeviceError where there are too few edges, or edges of another signal.
    """
    if len(edges_ns) < FEWEST:
        raise DeviceError(f"found {len(edges_ns)} edges, wanted at least {FEWEST}; check wire, channel and GPIO line")
    steps = [after - before for before, after in pairwise(edges_ns)]
    period_ns = max(1.0, statistics.median(steps))
    counts = [round(step / period_ns) for step in steps]
    wrong = [step for step, n in zip(steps, counts, strict=True) if abs(step / period_ns - n) > IRREGULAR]
    if len(wrong) > len(steps) // 100:
        raise DeviceError(f"found {len(wrong)} of {len(steps)} intervals irregular, wanted pulses; check the wire")
    found_Hz = STEPS * (prescale + 1) * sum(counts) * 1e9 / max(1, edges_ns[-1] - edges_ns[0])
    if not BELIEVABLE_Hz[0] <= found_Hz <= BELIEVABLE_Hz[1]:
        raise DeviceError(f"found {found_Hz / 1e6:.3f} MHz, wanted 20 to 50 MHz; is another signal on the line?")
    return found_Hz


def _channel(channel: int, off: int) -> bytes:
    return bytes([LED0 + 4 * channel, 0, 0, *off.to_bytes(2, "little")])
