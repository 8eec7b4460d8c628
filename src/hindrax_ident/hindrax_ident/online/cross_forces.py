"""What motion along the other axes does to one, as columns of its regression: off-diagonal mass, lift, Munk, Coriolis.

In a record of another stack all axes may move at once. These forces of a hull are then as large as its drag, in roll
and pitch a hundred times as large; taken for noise, they make an estimate confidently wrong. So they are unknowns, each
with the prior that the fit of all axes has (`model.six_axes`), and one for what the mass of each other axis differs
from that which is taken for known (`coriolis`).

Symbols. nu (6,) velocities, m the k columns: combinations of those terms, each of one prior deviation. A force of a
hull is a sum of products of two velocities, one of them perhaps without its sign, and of turns by the speed of the
center: linear in features f(nu), so m = A nu' + B f(nu), A (k, 6) of the masses that this axis shares with others.
"""

from collections.abc import Sequence

import numpy as np

from hindrax_core.signals import ZERO6
from hindrax_core.vehicle import Vehicle
from hindrax_ident.arrays import Array, array
from hindrax_ident.model.coriolis import USUAL_MASS_RATIO_SIGMA
from hindrax_ident.model.motion_model import Model, rigid_mass
from hindrax_ident.model.six_axes import State, cross_terms, inertial_force, symmetric, whole_speed

_FIRST, _SECOND = np.triu_indices(6)
NOTHING = 1e-9
"""Share of the largest combination below which one is rounding."""


class CrossForces:
    """Columns of one axis; `nu`: present velocities of all axes, of which the own one does not count [m/s, rad/s]."""

    def __init__(self, vehicle: Vehicle, model: Model) -> None:
        """Priors are made of the vehicle's size and mass."""
        axis = self._axis = model.axis
        # Any velocities tell which features a force consists of: it has fewer coefficients than these are.
        nu = np.random.default_rng(0).normal(size=(200, 6))
        still = np.zeros_like(nu)
        state = State(nu, still, still, still[:, :2])
        columns, accelerated = [], []
        for term in cross_terms(vehicle, axis) + ([] if model.crossed else [whole_speed(vehicle, axis)]):
            columns.append(term.sigma * term.force(state).get(axis, np.zeros(len(nu))))
            accelerated.append(term.sigma * symmetric(term.mass)[axis] if term.mass else np.zeros(6))
        for other in range(6):
            size = USUAL_MASS_RATIO_SIGMA * rigid_mass(vehicle, other) if other != axis else 0.0
            columns.append(inertial_force(size * symmetric((other, other)), nu, still)[:, axis])
            accelerated.append(np.zeros(6))
        features = np.stack([self._features(one) for one in nu])
        B = np.linalg.lstsq(features, np.stack(columns, axis=1), rcond=None)[0].T
        # Some do the same, such as lift and the masses of surge and heave in pitch: as few combinations of them, of one
        # deviation each, have the same prior.
        _, sizes, rows = np.linalg.svd(np.hstack([accelerated, B]), full_matrices=False)
        independent = (sizes[:, None] * rows)[sizes > NOTHING * sizes[0]]
        self._A, self._B = array(independent[:, :6]), array(independent[:, 6:])
        self.nu: Sequence[float] = ZERO6
        self.restart(0.0)

    def __len__(self) -> int:
        return len(self._A)

    def restart(self, v: float) -> None:
        """Forget what went through the filter; `v`: own velocity now [m/s, rad/s]."""
        self._sums: Array = np.zeros(len(self))
        self._nu = self._all(v)
        self._forces = array(self._B @ self._features(self._nu))
        self._before: tuple[Array, Array, Array] = self._sums, self._nu, self._forces

    def undo_last(self) -> None:
        """Undo the last `advance`."""
        self._sums, self._nu, self._forces = self._before

    def advance(self, step: float, weights: tuple[float, float, float], v: float) -> None:
        """Advance the filter of the regression over one interval, for velocities that are linear in it.

        Parameters
        ----------
        step : [s]
            Since the last call, above zero.
        weights
            What is kept of what was filtered [-], and what the inputs at begin and end of the interval count [s].
        v : [m/s, rad/s]
            Own velocity at the end.
        """
        self._before = self._sums, self._nu, self._forces
        kept, first, last = weights
        nu = self._all(v)
        forces = array(self._B @ self._features(nu))
        pushed = self._A @ (nu - self._nu) * ((first + last) / step)
        self._sums = array(kept * self._sums + first * self._forces + last * forces + pushed)
        self._nu, self._forces = nu, forces

    @property
    def filtered(self) -> tuple[float, ...]:
        """Filtered forces that resist, each of one prior deviation: (k,) [N s, N m s]."""
        return tuple(self._sums.tolist())

    def _all(self, v: float) -> Array:
        nu = np.array(self.nu)
        nu[self._axis] = v
        return nu

    def _features(self, nu: Array) -> Array:
        """Products of two velocities, squares with their signs, both speeds by the own velocity: (29,)."""
        v, size = nu[self._axis], np.abs(nu)
        center, turn = np.sqrt(nu[:3] @ nu[:3]), np.sqrt(nu[3:] @ nu[3:])
        return array(np.concatenate([nu[_FIRST] * nu[_SECOND], size * nu, [v * center, v * turn]]))
