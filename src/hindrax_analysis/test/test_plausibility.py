"""What nobody measured does not count as a fact."""

from dataclasses import replace

import numpy as np
import pytest

from hindrax_analysis.records.plausibility import INERTIA_SHARE, with_inertia_uncertainty
from hindrax_core.vehicle import Vehicle
from hindrax_ident.assess.results import Contribution, MotionResult, Number

BOX = Vehicle("box", mass_kg=20.0, volume_m3=0.0203, envelope_m=(0.6, 0.5, 0.4))
FOUND = Number(0.8, 0.01, 0.02, unit="kg m^2")


def turned(motion: str) -> MotionResult:
    return MotionResult(
        motion, "output-error", {"added_mass": FOUND}, identifiable=True, speeds=(0.1, 1.0), names=("added_mass",),
        covariance=np.eye(1), samples=100, effective_samples=90.0,
        budget={"added_mass": [Contribution("noise", 0.01, "")]},
    )  # fmt: skip


def test_the_added_mass_of_a_turn_is_no_better_than_an_inertia_that_nobody_named() -> None:
    found = with_inertia_uncertainty(turned("yaw"), BOX)
    doubt = INERTIA_SHARE * 20.0 * (0.6**2 + 0.5**2) / 12.0
    assert found.coefficients["added_mass"].std_calibrated == pytest.approx(np.hypot(0.02, doubt))
    assert found.coefficients["added_mass"].std == FOUND.std
    assert [row.influence for row in found.budget["added_mass"]] == ["inertia of the body", "noise"]


def test_an_inertia_that_was_named_is_accepted_and_a_mass_always() -> None:
    assert with_inertia_uncertainty(turned("yaw"), replace(BOX, inertia_kgm2=(0.5, 0.6, 0.7))) == turned("yaw")
    assert with_inertia_uncertainty(turned("surge"), BOX) == turned("surge")
