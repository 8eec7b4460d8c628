"""What differs between runs widens a pooled result, with everything that is said of its band."""

import math

import numpy as np
import pytest

from hindrax_analysis.identification.record_identification import widened_by_scatter
from hindrax_analysis.report.comparison import RunScatter
from hindrax_ident.assess.results import DragBand, MotionResult, NextStep, Number
from hindrax_ident.remedies import Remedy

SPEED = np.array([0.1, 0.5])
NOISE, CALIBRATED, AFTER = 0.2, 1.0, 0.4
POOLED = MotionResult(
    motion="surge",
    method="output-error",
    coefficients={"k_q": Number(66.0, NOISE / 0.25, 4.0), "k_l": Number(1.0, 0.0, 0.1)},
    names=("k_q", "k_l"),
    covariance=np.diag([(NOISE / 0.25) ** 2, 0.0]),
    samples=100,
    effective_samples=50.0,
    identifiable=True,
    reasons=(),
    speeds=(0.1, 0.5),
    drag=DragBand(SPEED, 66.0 * SPEED**2, NOISE / 0.25 * SPEED**2, np.array([0.04, CALIBRATED])),
    next_step=NextStep(Remedy("measure the thrust"), AFTER),
)


def scatter(ratio: float) -> RunScatter:
    """Runs whose k_q differs by so many deviations of the pooled one."""
    std = ratio * POOLED.coefficients["k_q"].std
    return RunScatter(mean=66.0, std=std, std_calibrated=std, scatter=std, between=std, ratio=ratio, runs=3)


@pytest.mark.parametrize("ratio", [1.0, 5.0])
def test_no_next_experiment_takes_away_what_differs_between_the_runs(ratio: float) -> None:
    found = widened_by_scatter(POOLED, {"k_q": scatter(ratio)})
    assert found.drag is not None
    assert found.next_step is not None
    added = NOISE**2 * (ratio**2 - 1.0)
    assert found.drag.std_calibrated[-1] == pytest.approx(math.sqrt(CALIBRATED**2 + added))
    assert found.next_step.std == pytest.approx(math.sqrt(AFTER**2 + added))
