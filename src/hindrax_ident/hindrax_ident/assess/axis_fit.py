"""One axis of one run, as the influence quantities see it: what they do to its record follows from these."""

import itertools
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hindrax_core.vehicle import AXES, AxisGain, Vehicle
from hindrax_ident.arrays import Array, Index, array, largest
from hindrax_ident.assess.thrust_calibration import thrust_shares
from hindrax_ident.fit.output_error import OutputErrorFit
from hindrax_ident.model.simulation import per_step
from hindrax_ident.model.six_axes import inertial_force, symmetric
from hindrax_ident.model.thrust_lag import LaggedThrust
from hindrax_ident.records.axis_record import Record
from hindrax_ident.tuning import Tuning

OWN_CONDITIONS_S = 900.0
"""After a longer pause a run has unknowns of its own: water, trim and battery are those of another hour."""
MOST_RUNS = 8
"""Runs of a pooled record that have unknowns of their own, at most: their number is that of the explanations."""
FOUND_DELAY_S = 0.1
"""Prior standard deviation of a delay that the record gave against the vehicle file."""
CROSS_DRAG, OFF_DIAGONAL = 0.5, 0.1
"""Standard deviations of the drag that an axis has from the speed across it, of that of one speed, and of off-diagonal
terms of added mass and drag, of the own ones [-]."""
LEAST_CROSSING = 0.003
"""Impulse of another axis, of those of the thrust, below which it is nothing [-]."""
MOST_CROSSINGS = 4
SMOOTH_S = 0.4
"""Mean of a velocity before its change: that of one sample is noise."""
SURGE, HEAVE, ROLL, PITCH, YAW = 0, 2, 3, 4, 5
NOT_WEIGHED = AxisGain(load=1.0, sigma=0.0)


@dataclass(frozen=True)
class AxisFit:
    """One axis of one run: its vehicle, record, fit and tuning; arrays on the fit's grid, (n,) each."""

    vehicle: Vehicle
    record: Record
    fit: OutputErrorFit
    tuning: Tuning
    delay_found: bool = False
    """Whether lag or latency of the record were estimated, against the vehicle file."""

    @property
    def axis(self) -> int:
        """Axis of the fit: 0 to 5."""
        return self.fit.model.axis

    @property
    def weighing(self) -> AxisGain:
        """Result of a known weight on this axis, perhaps in no direction."""
        return self.vehicle.thrust_gain.get(AXES[self.axis], NOT_WEIGHED)

    @property
    def weighed(self) -> tuple[float, ...]:
        """Directions in which a known weight measured the thrust: signs."""
        ways = ((1.0, self.weighing.positive), (-1.0, self.weighing.negative))
        return tuple(sign for sign, one in ways if one is not None)

    @cached_property
    def steps_s(self) -> Array:
        """Length of the step that ends at each time: (n,) [s]."""
        return self.fit.problem.grid.steps_s

    @property
    def v(self) -> Array:
        """Fitted velocity: (n,) [m/s, rad/s]."""
        return self.fit.linear.path.v

    @cached_property
    def thrust(self) -> Array:
        """Thrust after its lag: (n,) [N, N m]."""
        return self.record.lagged().force(self.thrust_s)

    @cached_property
    def inflow(self) -> Array:
        """Loss of thrust per inflow, after the lag: (n,) [N^0.5, N^0.5 m^2]; as a rule where it is not recorded.

        Then each thruster has its share of the thrust, and some hold the net buoyancy in every motion.
        """
        recorded, vehicle = self.record.forces, self.vehicle
        if len(recorded):
            return recorded.inflow(self.thrust_s, self.record.lag_s)
        held_N = 0.0 if self.axis == HEAVE else vehicle.net_buoyancy_N
        shares = thrust_shares(vehicle, HEAVE) if vehicle.thrusters else {}
        holding = {index: share for index, (_, share) in shares.items()}
        out = np.zeros(len(self.v))
        for index, (per_newton, share) in thrust_shares(vehicle, self.axis).items():
            out += per_newton**2 * np.sqrt(np.abs(share * self.thrust + holding.get(index, 0.0) * held_N))
        return out

    @cached_property
    def others(self) -> Array:
        """Velocities of all axes in units of this one's, by the length of the vehicle; its own zero: (n, 6)."""
        t = self.fit.problem.grid.times_s
        if not self.record.others:
            return np.zeros((len(t), 6))
        wanted = round(SMOOTH_S / max(1e-9, float(np.median(self.steps_s[self.steps_s > 0.0]))))
        kernel = np.ones(min(max(1, wanted), len(t)))  # of a flight that was cut off there is less than that
        weight = np.convolve(np.ones(len(t)), kernel, "same")
        rows = [np.convolve(np.interp(t, one.t, one.y), kernel, "same") / weight for one in self.record.others]
        return np.stack(rows, axis=1) * self._to_own

    @cached_property
    def crossing(self) -> Array:
        """Impulses of what the other axes do to this one, each of one deviation: (n, k), k at most MOST_CROSSINGS.

        Off-diagonal added mass and drag of each axis, and the drag that grows with the whole speed; of all these the
        combinations that do most, as unknowns of one deviation may be rotated.
        """
        others = self.others
        own_kind = others[:, :3] if self.axis < 3 else others[:, 3:]
        whole = np.sqrt(self.v**2 + np.sum(own_kind**2, axis=1))
        # A fit that has this drag as its parameter k_w knows it, and how well.
        cross = 0.0 if self.fit.model.crossed else CROSS_DRAG
        across = -self.top_drag / max(1e-9, self.speed**2) * (whole - np.abs(self.v)) * self.v
        drags = self.top_drag / max(1e-9, self.speed**2) * np.abs(others) * others
        columns = [
            self.of_force(cross * across),
            self.of_force(OFF_DIAGONAL * drags),
            self._off_diagonal_masses(),
        ]
        U, sizes, _ = np.linalg.svd(np.hstack(columns), full_matrices=False)
        matters = sizes[:MOST_CROSSINGS] > LEAST_CROSSING * np.linalg.norm(self.of_force(self.thrust))
        return array((U * sizes)[:, :MOST_CROSSINGS][:, matters])

    @cached_property
    def _to_own(self) -> Array:
        """Velocity of each axis in the unit of this one, by the length of the vehicle: (6,) [-, m, 1/m]."""
        length = self.vehicle.characteristic_length_m
        return array(np.where(np.arange(6) >= 3, length, 1.0) / (length if self.axis >= 3 else 1.0))

    def _off_diagonal_masses(self) -> Array:
        """Impulses of off-diagonal masses, each of one deviation: (n, k) [N s, N m s].

        M_ab carries momentum along a by motion along b. Where a is this axis, its change is an acceleration here; and
        all momentum turns with the body (Kirchhoff): a force across motions that neither need accelerate. Pairs are
        those with this axis, and those of a hull with port alike starboard: surge, heave, pitch and sway, roll, yaw.
        """
        nu = self.others / self._to_own
        nu[:, self.axis] = self.v
        own = self.mass * self._to_own**2
        columns = []
        for a, b in itertools.combinations(range(6), 2):
            if self.axis in (a, b) or (b - a) % 2 == 0:
                M = OFF_DIAGONAL * math.sqrt(own[a] * own[b]) * symmetric((a, b))
                change = per_step(nu @ M[self.axis], self.fit.problem.grid.starts)
                turned = inertial_force(M, nu, np.zeros_like(nu))[:, self.axis]
                columns.append(-change - self.of_force(turned)[:, 0])
        return np.stack(columns, axis=1)

    @cached_property
    def speed(self) -> float:
        """Highest speed [m/s, rad/s]."""
        return largest(self.v)

    @cached_property
    def pull(self) -> float:
        """Largest thrust commanded [N, N m]."""
        return largest(self.record.thrust.y)

    @property
    def thrust_s(self) -> Array:
        """Times of the grid by the stamps of the thrust: (n,) [s]."""
        return self.fit.problem.grid.times_s - self.record.latency_s

    @property
    def stamp_doubt_s(self) -> float:
        """Standard deviation of the stamps that residuals cannot correct [s].

        A motion that comes before its thrust is one by stamps that are off, or by forces that nobody recorded: no
        record tells which, so all of the time by which it comes first is doubt.
        """
        early_s = -(self.record.lag_s + self.record.latency_s)
        return max(0.0 if self.tuning.stamp_doubt_s is None else self.tuning.stamp_doubt_s, early_s)

    @property
    def look_sigma_s(self) -> float:
        """Standard deviation of the time of the thrust, where its changes are seen at the next look only [s].

        Each is late by any part of the time between two looks, and by another part than the next; the mean is in the
        lag. Changes count by their squares, as in a fit.
        """
        power = np.diff(self.record.thrust.y) ** 2
        share = float(np.linalg.norm(power)) / max(1e-12, float(np.sum(power)))
        return self.vehicle.output.looks_s * share / math.sqrt(12.0)

    @property
    def thrust_doubt(self) -> float:
        """Unmodeled dead band or pull as a share of the largest thrust [-]."""
        return 0.0 if self.tuning.thrust_doubt is None else self.tuning.thrust_doubt

    @property
    def delay_sigma_s(self) -> float:
        """Prior standard deviation of lag and latency [s]."""
        found_s = FOUND_DELAY_S if self.delay_found else 0.0
        return max(self.tuning.timing_sigma_s, self.tuning.lag_doubt_s or 0.0, found_s)

    @property
    def delays_fitted(self) -> bool:
        """Whether lag and latency were fitted together with the parameters."""
        return self.delay_found or self.tuning.lag_doubt_s is not None

    def drag(self, v: Array) -> Array:
        """Drag of the fit at velocities (n,): (n,) [N, N m]."""
        drags = self.fit.model.drags
        return self.fit.model.columns(v, v)[:, :drags] @ self.fit.theta[:drags]

    @cached_property
    def top_drag(self) -> float:
        """Drag at the highest speed, without its sign [N, N m]."""
        return float(np.abs(self.drag(array([self.speed]))[0]))

    def slope(self) -> Array:
        """Derivative of the drag: (n,) [N s/m, N m s]."""
        return self.fit.model.slope(self.fit.theta, self.v, self.fit.problem.grid.across)

    @property
    def mass(self) -> float:
        """Total mass or inertia of the fit [kg, kg m^2]."""
        return float(self.fit.theta[-1])

    def of_force(self, force: Array) -> Array:
        """Impulses over each step of forces at its ends, (n,) or (n, k): (n, k) [N s, N m s]."""
        table = np.column_stack([force])
        return 0.5 * self.steps_s[:, None] * (table + np.roll(table, 1, axis=0))

    def of_commands(self, commands: Array, times_s: Array | None = None) -> Array:
        """Impulses over each step of errors of the commanded thrust, through its lag.

        Parameters
        ----------
        commands : (c, k) [N, N m per unit]
            Errors of k influences for each command.
        times_s : (c,) [s]
            From when on each is in force; None: those of the thrust.

        Returns
        -------
        Array
            (n, k) [N s, N m s per unit], zero at the start of a stretch.
        """
        times_s = self.record.thrust.t if times_s is None else times_s
        totals = [LaggedThrust(times_s, one, self.record.lag_s) for one in commands.T]
        return per_step(np.stack([one.impulse(self.thrust_s) for one in totals], axis=1), self.fit.problem.grid.starts)

    def delayed(self, time_s: float) -> Array:
        """Velocity through a first-order lag, from rest at the start of each stretch: (n,) [m/s, rad/s]."""
        out: list[float] = []
        keep = np.exp(-self.steps_s / time_s).tolist()
        for v, one, start in zip(self.v.tolist(), keep, self.fit.problem.grid.starts.tolist(), strict=True):
            out.append(v if start else v + (out[-1] - v) * one)
        return np.array(out)

    @cached_property
    def run(self) -> Index:
        """Number of the run of each time, where records of several are pooled: (n,), from 0."""
        t = self.fit.problem.grid.times_s
        return np.cumsum(np.diff(t, prepend=t[:1]) > OWN_CONDITIONS_S, dtype=np.intp)

    def each_run(self, columns: Array) -> Array:
        """Columns (n, k) that are unknowns of each run by itself: (n, k r), r the longest MOST_RUNS of all runs."""
        longest = np.argsort(-np.bincount(self.run), kind="stable")[:MOST_RUNS]
        return np.hstack([np.where(self.run[:, None] == one, columns, 0.0) for one in longest])

    @property
    def position(self) -> Array:
        """Position from the middle of the flown distance, in units of half of it: (n,) [-]."""
        s = self.fit.linear.path.s - float(np.median(self.fit.linear.path.s))
        return s / max(1e-9, largest(s))
