"""Thrust tables: exact inverse, what is between the voltages, and the mock beside the stack."""

from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hindrax_control.allocation.thrust_curve import ThrustCurve
from hindrax_core.errors import UsageError
from hindrax_core.thrust.curves import Branch, Curve, problems_of
from hindrax_core.thrust.table import ThrustTable
from hindrax_core.vehicle import vehicle_from_text

PULSES = (1100.0, 1110.0, 1300.0, 1460.0, 1468.0, 1500.0, 1532.0, 1540.0, 1700.0, 1900.0)
AT_12 = (-28.0, -28.0, -10.0, -0.3, 0.0, 0.0, 0.0, 0.4, 12.0, 36.0)
AT_16 = (-40.0, -39.0, -15.0, -0.7, -0.35, 0.0, 0.4, 0.8, 17.6, 51.0)
TABLE = ThrustTable(PULSES, (12.0, 16.0), (AT_12, AT_16))
CURVE = Curve(table=TABLE)
VOLTS = st.floats(9.0, 20.0)


def test_forces_at_and_between_the_voltages() -> None:
    assert ThrustCurve(CURVE, 12.0).force(1300.0) == -10.0
    assert ThrustCurve(CURVE, 16.0).force(1300.0) == -15.0
    assert ThrustCurve(CURVE, 15.0).force(1300.0) == pytest.approx(-13.75)
    assert ThrustCurve(CURVE, 12.0).force(1620.0) == pytest.approx(6.2)
    assert ThrustCurve(CURVE, 20.0).force(1900.0) == pytest.approx(51.0 * (20.0 / 16.0) ** 1.2)
    assert ThrustCurve(CURVE, 10.0).force(1900.0) == pytest.approx(36.0 * (10.0 / 12.0) ** 1.2)


def test_the_dead_band_is_that_of_the_zeros_at_the_voltage() -> None:
    low, high = ThrustCurve(CURVE, 12.0), ThrustCurve(CURVE, 16.0)
    assert (low.force(1468.0), low.force(1532.0), low.gap_N) == (0.0, 0.0, (-0.3, 0.4))
    assert low.force(1464.0) == pytest.approx(-0.15), "rises evenly from the last pulse without thrust"
    assert high.force(1532.0) == pytest.approx(0.4)
    assert high.force(1516.0) == pytest.approx(0.2)


def test_a_flat_end_belongs_to_the_pulse_that_first_gives_it() -> None:
    curve = ThrustCurve(CURVE, 12.0)
    assert curve.range_N == (-28.0, 36.0)
    assert curve.pulse(-28.0) == curve.pulse(-99.0) == 1110.0
    assert curve.force(1050.0) == -28.0


@given(st.floats(-60.0, 80.0), VOLTS, st.booleans())
def test_force_undoes_pulse(force: float, volts: float, mirrored: bool) -> None:
    curve = ThrustCurve(CURVE, volts, mirrored=mirrored)
    reachable = max(curve.range_N[0], min(curve.range_N[1], force))
    if curve.gap_N[0] < reachable < curve.gap_N[1]:
        return
    assert curve.force(curve.pulse(reachable)) == pytest.approx(reachable, abs=1e-9)


@given(VOLTS, st.booleans(), st.floats(0.0, 20.0))
def test_thrust_rises_with_the_pulse_at_any_voltage(volts: float, mirrored: bool, margin_us: float) -> None:
    curve = ThrustCurve(CURVE, volts, mirrored=mirrored, margin_us=margin_us)
    forces = [curve.force(1100.0 + 2.0 * step) for step in range(401)]
    assert all(a <= b + 1e-12 for a, b in pairwise(forces[::-1] if mirrored else forces))


def test_a_margin_widens_the_dead_band_and_cuts_what_runs() -> None:
    curve = ThrustCurve(CURVE, 12.0, margin_us=40.0)
    assert curve.force(1430.0) == 0.0
    assert curve.force(1428.0) == pytest.approx(curve.gap_N[0])
    assert curve.gap_N[0] == pytest.approx(-0.3 - 9.7 * (1460.0 - 1428.0) / 160.0)


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        ((*AT_16[:-1], 10.0), "does not rise from 1700 to 1900 us"),
        ((*AT_16[:5], 0.1, *AT_16[6:]), "gives 0.1 N at 1500 us, wanted none at the stop pulse"),
        ((5.0, *AT_16[1:]), "gives 5 N at 1100 us, wanted none or a negative force"),
        ((*AT_16[:6], 0.0, 0.0, 0.0, 3.0), "has 1 positive forces that rise, wanted two or more"),
        ((*AT_16[:6], 0.4, 0.0, 1.0, 3.0), "gives nothing at 1540 us, and thrust nearer to the stop"),
    ],
)
def test_what_cannot_be_thrust_is_refused(rows: tuple[float, ...], reason: str) -> None:
    problems = problems_of(Curve(table=replace(TABLE, force_N=(AT_12, rows))))
    assert any(reason in problem and "at 16 V" in problem for problem in problems), problems
    with pytest.raises(UsageError, match="table at 16 V"):
        ThrustCurve(Curve(table=replace(TABLE, force_N=(AT_12, rows))))


def test_shape_and_two_answers_are_refused() -> None:
    with pytest.raises(ValueError, match="rows, wanted one for each of 2"):
        replace(TABLE, force_N=(AT_12,))
    with pytest.raises(ValueError, match="at 16 V: found 9 forces, wanted 10"):
        replace(TABLE, force_N=(AT_12, AT_16[1:]))
    with pytest.raises(ValueError, match="numbers that rise"):
        replace(TABLE, supply_V=(16.0, 12.0))
    cubic = Branch((-151.0, 0.1, 0.0, 0.0), 1100.0, 1475.0)
    with pytest.raises(ValueError, match="found both"):
        Curve(cubic, table=TABLE)
    with pytest.raises(ValueError, match="found neither"):
        Curve()
    with pytest.raises(ValueError, match="the table alone"):
        Curve(positive=cubic, table=TABLE)


@pytest.mark.parametrize(("rows_V", "expected"), [((12.0, 16.0), 14.8), ((10.0, 12.0), 12.0), ((18.0, 20.0), 18.0)])
def test_the_supply_of_a_file_is_one_of_its_table(rows_V: tuple[float, float], expected: float) -> None:
    text = f"""
name: v
mass_kg: 10.0
volume_m3: 0.01
envelope_m: [0.4, 0.3, 0.2]
curves:
  main: {{table: {{pulse_us: {list(PULSES)}, supply_V: {list(rows_V)}, force_N: {[list(AT_12), list(AT_16)]}}}}}
"""
    assert vehicle_from_text(text, "v.yaml").supply_V == expected
