"""Conditions of thrusters and battery. Each function adds one of them, of a size, to a world in the making.

Parameters
----------
world
    In the making; it gets the condition.
size
    In the unit of its row of `world_table`; behind "Size:" stands where a usual size comes from.
draws
    Random numbers of this condition, for what else is random in it.
"""

import heapq
import math
from collections.abc import Callable
from dataclasses import replace

from hindrax_core.readings import Vec6
from hindrax_core.signals import ZERO6
from hindrax_core.thrust.curves import Branch, Curve, running, slope, value
from hindrax_core.vehicle import Vehicle
from hindrax_sim.conditions.realization import Realization
from hindrax_sim.physics.geometry import combined, unit
from hindrax_sim.physics.normal_draws import NormalDraws
from hindrax_sim.physics.plant import Plant
from hindrax_sim.physics.thruster import thruster_A, wrench_per_newton

INFLOW_mps, INFLOW_N = 0.5, 10.0
NEIGHBORS = 2
SAG_S = 900.0
SUPPLY_EVERY_S = 0.1


def thrust_gain(world: Realization, size: float, _draws: NormalDraws) -> None:
    """All thrusters exceed their curve by a share.

    Size: Gain_sigma of a curve: bollard pull with a load cell.
    """
    _change_curves(world, lambda _index, curve: _gained(curve, 1.0 + size))


def weak_thruster(world: Realization, size: float, draws: NormalDraws) -> None:
    """One thruster, drawn at random, gives a share less.

    Size: A nicked propeller; our estimate.
    """
    weak = int(draws.uniform() * len(world.vehicle.thrusters))
    _change_curves(world, lambda index, curve: _gained(curve, 1.0 - size) if index == weak else curve)


def dead_bands(world: Realization, size: float, draws: NormalDraws) -> None:
    """The dead band of each thruster is wider by an independent normal draw, and its curve begins as much later.

    Size: A fifth of the speed controller's dead band; our estimate.
    """
    curves = (world.vehicle.curves[thruster.curve] for thruster in world.vehicle.thrusters)
    wider = [max(size * draws.normal(), -_narrowest_us(curve)) for curve in curves]
    _change_curves(world, lambda index, curve: with_later_start(curve, wider[index]))


def _change_curves(world: Realization, change: Callable[[int, Curve], Curve]) -> None:
    thrusters = world.vehicle.thrusters
    curves = {one.name: change(index, world.vehicle.curves[one.curve]) for index, one in enumerate(thrusters)}
    world.change_vehicle(
        curves={**world.vehicle.curves, **curves}, thrusters=tuple(replace(one, curve=one.name) for one in thrusters)
    )


def _gained(curve: Curve, gain: float) -> Curve:
    if curve.table is not None:
        rows = tuple(tuple(gain * force for force in row) for row in curve.table.force_N)
        return replace(curve, table=replace(curve.table, force_N=rows))
    positive = curve.positive and curve.positive.scaled(gain)
    return replace(curve, negative=curve.negative.scaled(gain), positive=positive)


def _narrowest_us(curve: Curve) -> float:
    """Half width of the dead band on its narrower side, of a table the part that no knot may leave."""
    if curve.table is None:
        return curve.dead_band_us
    ends = [running(curve, volts).dead_us for volts in curve.table.supply_V]
    return 0.9 * min(min(curve.stop_us - below, above - curve.stop_us) for below, above in ends)


def with_later_start(curve: Curve, wider_us: float) -> Curve:
    """Return the curve with a dead band that is wider by this on both sides, and begins as much later [us]."""
    if curve.table is not None:
        narrowest_us = _narrowest_us(curve)

        def moved(pulse_us: float) -> float:
            """Knots in the dead band move in proportion, so that they stay in order."""
            offset_us = pulse_us - curve.stop_us
            part = min(1.0, abs(offset_us) / narrowest_us) if narrowest_us else 1.0
            return pulse_us + math.copysign(part * wider_us, offset_us)

        return replace(curve, table=replace(curve.table, pulse_us=tuple(map(moved, curve.table.pulse_us))))
    negative, positive = _shifted(curve.negative, -wider_us), curve.positive and _shifted(curve.positive, wider_us)
    return replace(curve, negative=negative, positive=positive, dead_band_us=curve.dead_band_us + wider_us)


def _shifted(branch: Branch, by_us: float) -> Branch:
    """The branch at pulses later by `by_us`: G(P) = F(P - by), multiplied out."""
    _, _, c3, c4 = branch.c
    at = -by_us
    c = (value(branch.c, at), slope(branch.c, at), c3 + 3.0 * c4 * at, c4)
    return replace(branch, c=c, from_us=branch.from_us + by_us, to_us=branch.to_us + by_us)


def inflow_loss(world: Realization, size: float, _draws: NormalDraws) -> None:
    """Water that comes along a thruster's axis takes thrust: at 0.5 m/s this share of 10 N, with the root of thrust.

    Size: K_T falling evenly to zero at J = 0.8 to 1 takes 0.3 to 0.24 of 10 N of a propeller of 76 mm with K_T 0.41 at
    rest (36 N at 3100 rpm); a hull's wake and a rim drive take less.
    """
    # T = T_nn n|n| + T_nu |n| u (Fossen 2011 eq. 9.8), written with the force T_0 = T_nn n|n| at rest. So
    # T - T_0 = -c sqrt(|T_0|) u, where c loses the share `size` of 10 N at an inflow of 0.5 m/s.
    factor = size * math.sqrt(INFLOW_N) / INFLOW_mps
    rows = [(one.lag_s, wrench_per_newton(world.vehicle, one)) for one in world.vehicle.thrusters]
    thrusts_N = [0.0] * len(rows)

    def lose(plant: Plant, dt: float) -> Vec6:
        """Wrench of the losses of all thrusters; their forces follow the targets with the thrusters' lags."""
        u, v, w, p, q, r = plant.mid_step(dt)
        losses = []
        for index, (goal, (lag_s, per_newton)) in enumerate(zip(plant.targets_N, rows, strict=True)):
            keep = math.exp(-dt / lag_s) if lag_s > 0.0 else 0.0
            thrust = thrusts_N[index] = goal + keep * (thrusts_N[index] - goal)
            a, b, c, d, e, f = per_newton
            inflow = a * u + b * v + c * w + d * p + e * q + f * r
            losses.append((-factor * math.sqrt(abs(thrust)) * inflow, per_newton))
        return combined(losses)

    world.influences.append(lose)


def late_stops(world: Realization, size: float, _draws: NormalDraws) -> None:
    """The lag of thrust that goes is longer by this time than that of thrust that comes; what turns round goes first.

    Size: A propeller without a brake turns on in its wake; our estimate.
    """
    rows = [(one.lag_s, wrench_per_newton(world.vehicle, one)) for one in world.vehicle.thrusters]
    usual_N, late_N = [0.0] * len(rows), [0.0] * len(rows)

    def keep(plant: Plant, dt: float) -> Vec6:
        """Wrench of all thrusters by which it is more than with one lag, in the middle of the step."""
        more = []
        for index, (goal, (lag_s, per_newton)) in enumerate(zip(plant.targets_N, rows, strict=True)):
            before = late_N[index] - usual_N[index]
            usual_N[index] = _followed(usual_N[index], goal, lag_s, lag_s, dt)
            late_N[index] = _followed(late_N[index], goal, lag_s, lag_s + size, dt)
            more.append((0.5 * (before + late_N[index] - usual_N[index]), per_newton))
        return combined(more)

    world.influences.append(keep)


def _followed(thrust: float, goal: float, comes_s: float, goes_s: float, dt: float) -> float:
    """Thrust after a step: of what turns round the part up to zero goes, and the rest comes."""
    if thrust * goal < 0.0:
        zero_s = goes_s * math.log1p(-thrust / goal)
        if zero_s < dt:
            return _followed(0.0, goal, comes_s, goes_s, dt - zero_s)
        return goal + (thrust - goal) * math.exp(-dt / goes_s)
    lag_s = goes_s if abs(goal) < abs(thrust) else comes_s
    return goal + (thrust - goal) * math.exp(-dt / lag_s) if lag_s > 0.0 else goal


def thruster_wash(world: Realization, size: float, _draws: NormalDraws) -> None:
    """A thruster loses thrust to the wakes of its two nearest neighbors: of each pair a share of the geometric mean.

    Size: A rig gained 9 to 35 % by tilting its thrusters (Bulten, Stoltenkamp 2013).
    """
    places = [one.position_m for one in world.vehicle.thrusters]
    neighbors = [
        heapq.nsmallest(NEIGHBORS, {*range(len(places))} - {at}, key=lambda one: math.dist(places[one], place))
        for at, place in enumerate(places)
    ]

    def washed(forces: list[float]) -> list[float]:
        sums = (
            size * sum(math.sqrt(abs(force * forces[one])) for one in near)
            for force, near in zip(forces, neighbors, strict=True)
        )
        return [math.copysign(max(0.0, abs(force) - loss), force) for force, loss in zip(forces, sums, strict=True)]

    world.thrust_losses.append(washed)


def hull_wash(world: Realization, size: float, _draws: NormalDraws) -> None:
    """A thruster loses a share of its thrust where its jet runs towards the middle of the hull.

    Size: The same; COB-2023-1394 does not model it.
    """
    inward = [
        sum(a * b for a, b in zip(one.direction, unit(one.position_m), strict=True)) for one in world.vehicle.thrusters
    ]
    world.thrust_losses.append(
        lambda forces: [
            force * (1.0 - size) if force * towards > 0.0 else force
            for force, towards in zip(forces, inward, strict=True)
        ]
    )


def battery_sag(world: Realization, size: float, _draws: NormalDraws) -> None:
    """The supply loses a share of its voltage in 15 min, evenly; only a battery sensor shows it.

    Size: A lithium cell from 4.0 to 3.6 V.
    """
    _drop_supply(world, lambda time_s, _plant: world.vehicle.supply_V - sagged_V(world.vehicle, size, time_s))


def sagged_V(vehicle: Vehicle, size: float, time_s: float) -> float:
    """Supply at rest after some time of a flight that began with a full battery [V].

    Parameters
    ----------
    vehicle
        Whose nominal voltage a full battery has.
    size : [-]
        Of `battery_sag`, in 15 min.
    time_s : [s]
        Of the flight.

    Returns
    -------
    float
        [V].
    """
    return vehicle.supply_V * (1.0 - size * time_s / SAG_S)


def supply_resistance(world: Realization, size: float, _draws: NormalDraws) -> None:
    """Cable and battery have a resistance, so that the supply falls with the current of the thrusters.

    Size: Battery 20 mohm, cables and plugs 30 mohm; our estimate.
    """
    _drop_supply(world, lambda _time_s, plant: size * sum(map(thruster_A, plant.targets_N)))


def _drop_supply(world: Realization, drop_V: Callable[[float, Plant], float]) -> None:
    """Lower the supply below that of the vehicle file by a function of time [s] and plant, ten times a second."""
    was_V, next_s = 0.0, SUPPLY_EVERY_S

    def lower(plant: Plant, dt: float) -> Vec6:
        nonlocal was_V, next_s
        time_s = plant.time_s + dt
        if time_s >= next_s:
            next_s += SUPPLY_EVERY_S
            now_V = drop_V(time_s, plant)
            plant.supply_V -= now_V - was_V
            was_V = now_V
        return ZERO6

    world.influences.append(lower)
