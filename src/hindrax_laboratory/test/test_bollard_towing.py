"""Thrust curve and towing points: fits give back what made the points, with honest deviations."""

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_core.errors import HindraxError
from hindrax_core.knobs import build
from hindrax_core.thrust.curves import Curve
from hindrax_ident.arrays import Array
from hindrax_laboratory import bollard, towing

NEGATIVE = (927.1827, -2.2726, 0.001794, -4.61e-7)
PULSES = np.concatenate((np.arange(1100.0, 1481.0, 20.0), np.arange(1520.0, 1901.0, 20.0)))


def published(pulse: Array) -> Array:
    """Negative row of COB-2023-1394 Table 2, mirrored about the stop pulse."""
    c1, c2, c3, c4 = NEGATIVE
    folded = np.where(pulse < 1500.0, pulse, 3000.0 - pulse)
    force = ((c4 * folded + c3) * folded + c2) * folded + c1
    return np.where(pulse < 1500.0, force, -force)


def test_a_sweep_without_noise_gives_the_published_row_back() -> None:
    curve = bollard.fit(PULSES, published(PULSES) / 2.0, lever_ratio=2.0)
    assert [c.value for c in curve.negative.c] == pytest.approx(NEGATIVE, rel=1e-5)
    assert curve.negative.force_N(1300.0).value == pytest.approx(-8.15, abs=0.01)
    assert curve.positive.force_N(1700.0).value == pytest.approx(8.15, abs=0.01)
    assert curve.negative.monotone


@pytest.mark.parametrize("seed", range(5))
def test_deviations_cover_the_truth(seed: int) -> None:
    noise = np.random.default_rng(seed).normal(0.0, 0.05, PULSES.size)
    curve = bollard.fit(PULSES, published(PULSES) + noise)
    for pulse in (1150.0, 1250.0, 1400.0):
        found = curve.negative.force_N(pulse)
        assert abs(found.value - float(published(np.array([pulse]))[0])) < 4.0 * found.std
        assert found.std < 0.05
    assert curve.negative.residual_std_N == pytest.approx(0.05, rel=0.6)


def test_the_block_is_read_back_by_the_vehicle_file() -> None:
    noise = np.random.default_rng(0).normal(0.0, 0.05, PULSES.size)
    fitted = bollard.fit(PULSES, published(PULSES) + noise, supply_V=14.8)
    data = yaml.safe_load(bollard.vehicle_block(fitted, "main", "pool, 2 May"))
    curve = build(Curve, data["curves"]["main"], "block")
    assert curve.positive is not None
    for pulse in (1120.0, 1300.0, 1450.0):
        assert curve.negative.force_N(pulse) == pytest.approx(fitted.negative.force_N(pulse).value, abs=2e-3)
    assert (curve.supply_V, curve.source) == (14.8, "pool, 2 May")
    assert curve.gain_sigma == pytest.approx(fitted.gain_sigma, abs=1e-5)


def test_only_the_rising_part_goes_into_the_vehicle_file() -> None:
    bent = np.where(PULSES < 1500.0, published(PULSES), 15.0 * np.sin((PULSES - 1500.0) / 200.0))
    curve = bollard.fit(PULSES, bent)
    assert not curve.positive.monotone
    branch = curve.positive.branch()
    assert branch.to_us < 1860.0
    pulses = np.linspace(branch.from_us, branch.to_us, 50)
    assert np.all(np.diff([branch.force_N(p) for p in pulses]) > 0.0)


def test_wrong_signs_and_thin_sweeps_are_refused() -> None:
    with pytest.raises(HindraxError, match=r"does not grow .* change the sign of the load"):
        bollard.fit(PULSES, -published(PULSES))
    with pytest.raises(HindraxError, match="positive direction: found 2 different pulses"):
        bollard.fit(PULSES[:23], published(PULSES[:23]))


@pytest.mark.parametrize("factor", [1e-3, 1e-6, 10.0])
def test_pulses_of_another_unit_are_refused(factor: float) -> None:
    with pytest.raises(HindraxError, match=r"pulse_us runs from .*, wanted microseconds from 500 to 2500"):
        bollard.fit(PULSES * factor, published(PULSES))


@settings(max_examples=30)
@given(st.floats(0.1, 200.0), st.floats(0.0, 80.0), st.floats(-2.0, 2.0))
def test_towing_in_both_directions_gives_quadratic_linear_and_offset(k_q: float, k_l: float, b: float) -> None:
    speed = np.concatenate((-np.arange(0.1, 0.9, 0.1), np.arange(0.1, 0.9, 0.1)))
    found = towing.fit(speed, towing.drag_N(speed, k_q, k_l, b), offset=True, area_m2=0.0616)
    assert found.b is not None
    assert (found.k_q.value, found.k_l.value, found.b.value) == pytest.approx((k_q, k_l, b), abs=1e-6)
    assert found.drag_coefficient is not None
    assert found.drag_coefficient.value == pytest.approx(k_q / (500.0 * 0.0616), abs=1e-6)


def test_one_speed_cannot_separate_the_coefficients() -> None:
    with pytest.raises(HindraxError, match="same speed"):
        towing.fit(np.array([0.5, 0.5, -0.5]), np.array([3.0, 3.1, -3.0]))


def test_drag_that_pushes_on_is_refused() -> None:
    speed = np.array([0.2, 0.5, 1.0])
    with pytest.raises(HindraxError, match="change the sign"):
        towing.fit(speed, -60.0 * speed)
