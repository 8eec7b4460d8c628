"""The joint filter: as good as output error from a sane start, with velocity, with position, with both."""

import numpy as np
import pytest

from hindrax_ident.model.motion_model import Model
from hindrax_ident.online.joint_ekf import JointFilter
from hindrax_ident.testing.synthetic_runs import back_and_forth, fly

HEAVE = np.array([93.52, 5.26, 56.57, 11.84, 0.78, 37.7])
CASES = {
    "surge": (Model(0, 15.22), np.array([66.48, 1.25, 0.0, 27.3]), (4.0, 8.0, 13.0), (0.01, 0.0)),
    "heave": (Model(2, 15.22, split=True), HEAVE, (8.0, 16.0, 30.0), (0.0, 0.002)),
    "roll": (Model(3, 0.483, restores=True), np.array([1.29, 0.02, 0.0, 3.0, 0.733]), (0.5, 1.0, 1.3), (0.003, 0.002)),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_truth_lies_within_its_bands(name: str) -> None:
    model, theta, levels, (sigma_v, sigma_s) = CASES[name]
    flight = fly(model, theta, back_and_forth(levels, 6.0, 72.0), 0.15)
    rng = np.random.default_rng(3)
    kalman = JointFilter(model, 0.15, position_sigma=sigma_s or 1.0)
    guess = theta * np.where(np.abs(theta) > 0.05, 1.1, 1.0) + np.where(np.abs(theta) > 0.05, 0.0, 0.02)
    spread = np.diag((0.2 * np.abs(theta) + 0.05) ** 2)
    commands = list(zip(flight.times_s.tolist(), flight.commands.tolist(), strict=True))
    for k in range(0, len(flight.path.v), 8):
        t = float(flight.grid.times_s[k])
        while commands and commands[0][0] <= t:
            kalman.thrust(*commands.pop(0))
        if not kalman.started:
            kalman.start(t, guess, spread, sigma_v**2 or 1.0)
        if sigma_v:
            kalman.velocity(t, float(flight.path.v[k]) + sigma_v * rng.standard_normal())
        if sigma_s:
            kalman.position(t, float(flight.path.s[k]) + sigma_s * rng.standard_normal())
    found, C = kalman.estimate()
    sigma = np.sqrt(np.diag(C))
    assert np.abs((found - theta) / sigma).max() < 4.0
    assert sigma[0] < 0.05 * theta[0]


def test_it_does_nothing_before_it_is_started() -> None:
    kalman = JointFilter(Model(0, 15.22), 0.15)
    kalman.thrust(0.0, 5.0)
    kalman.velocity(0.1, 0.2)
    kalman.position(0.2, 0.1)
    assert not kalman.started
