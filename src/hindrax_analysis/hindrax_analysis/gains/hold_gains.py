"""Gains of our own holds from a result: the fastest with stated margins over its uncertainty, within the thrust."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from hindrax_analysis.coefficients_file import SavedCoefficients, as_fitted
from hindrax_analysis.exports.export_model import ExportModel, export_model, identified
from hindrax_analysis.exports.samples import sampled_models
from hindrax_control.hold.holds import HoldKnobs
from hindrax_control.hold.loop_margins import (
    MOST_SENSITIVITY,
    Law,
    LoopDelays,
    Margins,
    fastest_law,
    reference_rate,
    worst_margins,
)
from hindrax_control.hold.regulator import LIMIT_SHARE
from hindrax_control.hold.station_keeping import StationKeepingKnobs
from hindrax_control.maneuver.goal import largest_wrench
from hindrax_control.prior_dynamics import PriorDynamics, prior_dynamics
from hindrax_core.vehicle import AXES, Vehicle

VEHICLES, SEED = 100, 1
EFFORT = 0.5
"""Part of the largest thrust that a moving reference may take; the rest is for what disturbs, and for other axes."""
INTEGRAL = 0.3
"""Part of the largest thrust that the integral part may reach."""
DAMPINGS = (1.0, 1.25, 1.5)
"""Damping ratios tried. The law counts on the drag that it believes in; where that is uncertain, a vehicle with less of
it swings at one, and only a very slow law or a better damped one keeps the margins."""
GROUPS = (("surge", "sway"), ("heave", "roll", "pitch", "yaw"))
"""Axes that share a damping ratio: those of station keeping, and those of the holds."""


@dataclass(frozen=True, slots=True)
class AxisLimits:
    """Bandwidths [rad/s] that the knobs of an axis admit, delay of its state [s], largest rate of its reference."""

    span_radps: tuple[float, float]
    delay_s: float
    most_rate: float


LIMITS: Mapping[str, AxisLimits] = {
    # The navigator runs at 50 Hz; half a cycle waits for the state, half one for the output, the rest is transport.
    "surge": AxisLimits((0.1, 1.5), 0.15, 0.5),
    "sway": AxisLimits((0.1, 1.5), 0.15, 0.5),
    "heave": AxisLimits((0.1, 4.0), 0.06, 0.5),
    "roll": AxisLimits((0.1, 6.0), 0.05, 1.0),
    "pitch": AxisLimits((0.1, 6.0), 0.05, 1.0),
    "yaw": AxisLimits((0.1, 4.0), 0.05, 1.0),
}
"""A velocity sensor adds its interval and latency to surge and sway."""


@dataclass(frozen=True, slots=True)
class AxisGains:
    """Gains of one axis [N, N m; m, rad; s], the rate of its reference, its largest thrust, and what the law keeps."""

    law: Law
    rate: float
    thrust: float
    inertia: float
    margins: Margins
    """The worst over the vehicles drawn."""


@dataclass(frozen=True, slots=True)
class HoldGains:
    """Gains by axis of a vehicle, knobs of its holds and its station; `left_out`: axes that no thruster serves."""

    vehicle: Vehicle
    axes: Mapping[str, AxisGains]
    left_out: tuple[str, ...]
    drawn: int
    assumed: tuple[str, ...] = ()
    """Axes with the drag and added mass of the vehicle file, the same in every vehicle drawn."""

    @property
    def caution(self) -> str:
        """What the margins do not count; empty where every axis was identified."""
        if not self.assumed:
            return ""
        axes = ", ".join(self.assumed)
        return f"{axes}: not identified; drag and added mass of the vehicle file, as if they were exact"

    @property
    def holds(self) -> HoldKnobs:
        """Knobs of the holds; a loop that several axes share follows its slowest."""
        shipped, found = HoldKnobs(), self.axes
        knobs = shipped
        tilt = [found[axis] for axis in ("roll", "pitch") if axis in found]
        if tilt:
            slowest = min(one.law.bandwidth_radps for one in tilt)
            knobs = replace(knobs, tilt_bandwidth_radps=_rounded(slowest))
        turning = [found[axis] for axis in ("yaw",) if axis in found]
        if turning:
            yaw = turning[0]
            rate = min([yaw.rate, *(one.rate for one in tilt)])
            knobs = replace(
                knobs,
                heading_bandwidth_radps=_rounded(yaw.law.bandwidth_radps),
                turn_radps=_rounded(rate),
                integral_Nm=_rounded(INTEGRAL * min(one.thrust for one in (*turning, *tilt))),
            )
        if "heave" in found:
            heave = found["heave"]
            knobs = replace(
                knobs,
                vertical_bandwidth_radps=_rounded(heave.law.bandwidth_radps),
                climb_mps=_rounded(heave.rate),
                integral_N=_rounded(INTEGRAL * heave.thrust),
            )
        laws = [found[axis].law for axis in GROUPS[1] if axis in found]
        damping = max((law.damping for law in laws), default=shipped.damping)
        slowest_s = max((law.integral_s for law in laws), default=shipped.integral_s)
        return replace(knobs, damping=damping, integral_s=_rounded(slowest_s))

    @property
    def station(self) -> StationKeepingKnobs:
        """Knobs of station keeping: of the slower of surge and sway."""
        found = [self.axes[axis] for axis in ("surge", "sway") if axis in self.axes]
        if not found:
            return StationKeepingKnobs()
        slow = min(found, key=lambda one: one.law.bandwidth_radps)
        return StationKeepingKnobs(
            bandwidth_radps=_rounded(slow.law.bandwidth_radps),
            damping=slow.law.damping,
            integral_s=_rounded(slow.law.integral_s),
            speed_mps=_rounded(min(one.rate for one in found)),
            integral_N=_rounded(INTEGRAL * min(one.thrust for one in found)),
        )


def hold_gains(saved: SavedCoefficients, vehicle: Vehicle, source: str, *, complete: bool) -> HoldGains:
    """Gains from a result, robust over vehicles drawn from its uncertainty.

    Parameters
    ----------
    saved, vehicle, source, complete
        As of `export_model`, and so are the errors.

    Returns
    -------
    HoldGains
        For the vehicle with its losses: gains act on the commanded thrust.
    """
    # Gains act on the commanded thrust, so on a vehicle with its losses.
    saved = as_fitted(saved)
    model = export_model(saved, vehicle, source, complete=complete)
    drawn = list(sampled_models(saved, vehicle, source, VEHICLES, seed=SEED, complete=complete))
    found = designed(known(model), [known(one) for one in drawn])
    flown = {name.partition("_")[0] for name in identified(saved)}
    return replace(found, assumed=tuple(axis for axis in found.axes if axis not in flown))


def known(model: ExportModel) -> Vehicle:
    """The vehicle with the hydrodynamics of a model."""
    return replace(model.vehicle, hydrodynamics=model.hydrodynamics)


def designed(vehicle: Vehicle, drawn: Sequence[Vehicle]) -> HoldGains:
    """Gains for a vehicle, whose margins hold for it and for all of those drawn."""
    freedoms = [prior_dynamics(one) for one in (vehicle, *drawn)]
    thrust = largest_wrench(vehicle)
    lag_s = max((thruster.lag_s for thruster in vehicle.thrusters), default=0.0)
    limits = dict(zip(AXES, vehicle.limits.wrench, strict=True))
    served = [axis for axis in AXES if thrust[axis] > 0.0 and limits[axis] > 0.0]

    def of_group(group: Sequence[str], damping: float) -> dict[str, AxisGains]:
        return {
            axis: _axis(vehicle, axis, [one[axis] for one in freedoms], min(thrust[axis], limits[axis]), lag_s, damping)
            for axis in group
            if axis in served
        }

    tried = [[of_group(group, damping) for damping in DAMPINGS] for group in GROUPS]
    found = {axis: one for choices in tried for axis, one in max(choices, key=_merit).items()}
    axes = {axis: found[axis] for axis in served}
    return HoldGains(vehicle, axes, tuple(axis for axis in AXES if axis not in axes), len(drawn))


def _merit(found: Mapping[str, AxisGains]) -> tuple[int, float]:
    """How many axes keep the margins; then the logarithms of the bandwidths: twice as quick outweighs half as quick."""
    kept = sum(one.margins.sensitivity <= MOST_SENSITIVITY for one in found.values())
    return kept, sum(math.log(one.law.bandwidth_radps) for one in found.values())


def _axis(  # noqa: PLR0917  # what decides the gains of one axis
    vehicle: Vehicle, axis: str, freedoms: Sequence[PriorDynamics], thrust: float, lag_s: float, damping: float
) -> AxisGains:
    limits = LIMITS[axis]
    delays = LoopDelays(lag_s, limits.delay_s)
    law = fastest_law(freedoms, delays, damping=damping, span_radps=limits.span_radps)
    # The stiffest and heaviest of the vehicles decides what a reference may ask for.
    rate = min(reference_rate(one, law.bandwidth_radps, EFFORT * (thrust - abs(one.bias))) for one in freedoms)
    most = limits.most_rate
    if axis in AXES[:3]:
        most = min(most, LIMIT_SHARE * vehicle.limits.speed_mps)
    rate = max(0.02, min(rate, most))
    return AxisGains(law, rate, thrust, freedoms[0].inertia, worst_margins(law, freedoms, delays))


def _rounded(value: float) -> float:
    """Two significant digits, downwards: a gain is no more exact."""
    step = 10.0 ** (math.floor(math.log10(value)) - 1) if value > 0.0 else 1.0
    return round(math.floor(value / step + 1e-9) * step, 9)
