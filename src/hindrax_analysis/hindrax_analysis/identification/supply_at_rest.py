"""Thrust at supply voltages that were measured at rest, before and after a flight, where no sensor measured them.

A battery loses a tenth of its voltage in a quarter of an hour, and thrust goes with a power of it. What it loses under
load, between two readings at rest nobody sees: that stays in the budget as `sag under load`.
"""

import functools
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from hindrax_control.allocation.thrust_curve import SERVO_US, AppliedWrench, ThrustCurve, thrust_curves
from hindrax_core.events import Stamped, seconds_between
from hindrax_core.signals import IdentEvent, Supply, Thrust
from hindrax_core.thrust.curves import Curve
from hindrax_core.vehicle import AxisGain, Vehicle

STEP_V = 0.02
"""Voltages are taken in steps, each of which has curves of its own: a seventh of a percent of the force."""


@dataclass(frozen=True, slots=True)
class RestVolts:
    """Voltages of the supply with the thrusters at rest, before a flight and after it [V]."""

    before: float
    after: float


def at_rest_volts(
    events: Iterable[Stamped[IdentEvent]], vehicle: Vehicle, volts: RestVolts | None
) -> Iterator[Stamped[IdentEvent]]:
    """Events of a flight with its thrust at the voltage of the moment, which falls evenly from one reading to the next.

    Parameters
    ----------
    events
        In time order. Thrust that was computed with a measured voltage stays as it is.
    vehicle
        Whose curves and nominal voltage made the thrust.
    volts
        As they were read; None: nobody did, and all stays as it is.

    Yields
    ------
    Stamped[IdentEvent]
        The same events; forces of thrusters are those of the same pulses at the other voltage.
    """
    if volts is None:
        yield from events
        return
    flown = list(events)
    lasted_s = seconds_between(flown[0].stamp, flown[-1].stamp) if flown else 0.0
    wrench = AppliedWrench(vehicle).wrench
    forces_at = functools.cache(functools.partial(_forces_at, vehicle, thrust_curves(vehicle)))
    for event in flown:
        thrust = event.reading
        if isinstance(thrust, Thrust) and thrust.forces_N and thrust.supply < Supply.AT_REST:
            part = seconds_between(flown[0].stamp, event.stamp) / lasted_s if lasted_s > 0.0 else 0.0
            now_V = volts.before + part * (volts.after - volts.before)
            forces_N = forces_at(round(now_V / STEP_V))(thrust.forces_N)
            event = Stamped(event.stamp, Thrust(wrench(forces_N), forces_N, Supply.AT_REST))  # noqa: PLW2901
        yield event


def gain_at_rest_volts(gain: AxisGain, vehicle: Vehicle, volts: RestVolts) -> AxisGain:
    """Gain of a weighing whose thrust was that of the nominal voltage, at the voltage that the supply had then.

    Parameters
    ----------
    gain
        At the beginning of the weighing, which is what its drift refers to (`known_weight`).
    vehicle
        Whose curves and nominal voltage made the thrust.
    volts
        As they were read.

    Returns
    -------
    AxisGain
        What is left of the gain: the thrust of legs is taken at their own voltages.
    """
    nominal = thrust_curves(vehicle)
    forces_at = _forces_at(vehicle, nominal, round(volts.before / STEP_V))
    halves = [tuple(0.5 * curve.range_N[way] for curve in nominal) for way in (0, 1)]
    ratio = np.abs([forces_at(one) for one in halves]).sum() / np.abs(halves).sum()
    return replace(
        gain,
        positive=None if gain.positive is None else float(gain.positive / ratio),
        negative=None if gain.negative is None else float(gain.negative / ratio),
    )


def _forces_at(
    vehicle: Vehicle, nominal: Sequence[ThrustCurve], steps: int
) -> Callable[[Sequence[float]], tuple[float, ...]]:
    """Forces of the pulses that give others at the nominal voltage."""
    volts = steps * STEP_V
    of_each = [
        _force_at(vehicle.curves[one.curve], usual, now)
        for one, usual, now in zip(vehicle.thrusters, nominal, thrust_curves(vehicle, volts), strict=True)
    ]
    return lambda forces_N: tuple(made(force) for made, force in zip(of_each, forces_N, strict=True))


def _force_at(curve: Curve, nominal: ThrustCurve, now: ThrustCurve) -> Callable[[float], float]:
    if curve.table is None:  # cubics grow by one factor, also between dead band and branch
        gain = (now.supply_V / nominal.supply_V) ** curve.supply_exponent
        return lambda force_N: gain * force_N
    # Also below the smallest force that can be asked for, as from a pulse just outside the dead band.
    pulses_us = np.arange(*SERVO_US)
    before_N, now_N = ([of.force(one) for one in pulses_us.tolist()] for of in (nominal, now))
    return lambda force_N: float(np.interp(force_N, before_N, now_N)) if force_N else 0.0
