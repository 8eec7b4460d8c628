"""Thrust as manufacturers publish it: a workbook in the form of Blue Robotics' T200 data, its sheets as CSV, units.

The numbers are made by a law with the dead bands, the full thrust and the resolution (0.01 lbf) of the public workbook.
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.thrust.curves import Curve, running
from hindrax_ident.arrays import Array, array
from hindrax_laboratory.measured_table import measured_table
from hindrax_laboratory.thruster_sheets import Sheet, is_published, sheets_of

KGF, LBF = 9.80665, 4.4482216152605
HEADER = (" PWM (µs)", " RPM", " Current (A)", " Voltage (V)", " Power (W)", " Force (Kg f)", " Efficiency (g/W)")
# Volts; half width of the band without thrust [us]; full thrust ahead [N], that astern is 0.78 of it.
SHEETS = ((10.0, 40.0, 28.7), (12.0, 36.0, 36.4), (14.0, 32.0, 44.4), (16.0, 28.0, 51.4))
PULSES = array(np.arange(1100.0, 1901.0, 4.0))


def law(pulse: Array, half_us: float, full_N: float) -> Array:
    """Force [N] (n,) of pulses [us]: nothing in the band, a power of the distance from it beyond."""
    beyond = np.clip(np.abs(pulse - 1500.0) - half_us, 0.0, None) / (400.0 - half_us)
    return array(np.sign(pulse - 1500.0) * np.where(pulse < 1500.0, 0.78, 1.0) * full_N * beyond**1.5)


def measured(half_us: float, full_N: float, seed: int = 0) -> Array:
    """The same with the scatter and the resolution of the stand."""
    force = law(PULSES, half_us, full_N)
    noisy = force * (1.0 + np.random.default_rng(seed).normal(0.0, 0.004, force.size))
    return array(np.round(noisy / LBF, 2) * LBF)


def rows(volts: float, half_us: float, full_N: float) -> list[tuple[float, ...]]:
    return [(p, 0.0, 0.1, volts, volts, f / KGF, 9.0) for p, f in zip(PULSES, measured(half_us, full_N), strict=True)]


def new_workbook() -> Any:
    """An empty workbook; skips where openpyxl is not installed, which is an extra of the wheel."""
    return pytest.importorskip("openpyxl").Workbook()


@pytest.fixture(scope="module")
def workbook(tmp_path_factory: pytest.TempPathFactory) -> Path:
    book = new_workbook()
    first = book.active
    assert first is not None
    first.title = "READ ME FIRST"
    for volts, half_us, full_N in reversed(SHEETS):
        sheet = book.create_sheet(f"{volts:g} V")
        for row in (HEADER, *rows(volts, half_us, full_N)):
            sheet.append(row)
    file = tmp_path_factory.mktemp("data") / "T200-Public-Performance-Data.xlsx"
    book.save(file)
    return file


def test_the_workbook_is_read_as_it_is(workbook: Path) -> None:
    assert is_published(workbook)
    sheets = sheets_of(workbook)
    assert [sheet.supply_V for sheet in sheets] == [10.0, 12.0, 14.0, 16.0]
    assert sheets[0].force_N == pytest.approx(measured(40.0, 28.7), abs=1e-9)


def test_dead_bands_are_those_of_the_data_and_thrust_that_of_the_law(workbook: Path) -> None:
    found = measured_table(sheets_of(workbook))
    assert [high for _, high in found.dead_us] == pytest.approx([1500.0 + half for _, half, _ in SHEETS], abs=8.0)
    assert found.residual_N < 0.15
    assert len(found.table.pulse_us) < 70, "only the knots that are needed"
    curve = Curve(table=found.table)
    for volts, half_us, full_N in SHEETS:
        now = running(curve, volts)
        forth = array(np.linspace(1500.0 + half_us + 16.0, 1890.0, 50))
        for pulse, force in zip(forth, law(forth, half_us, full_N), strict=True):
            assert now.positive.force_N(pulse) == pytest.approx(force, rel=0.03, abs=0.06)
    between = running(curve, 13.0)
    assert between.range_N[1] == pytest.approx(0.5 * (36.4 + 44.4), rel=0.01)


@pytest.mark.parametrize(
    ("header", "newtons"),
    [
        ("PWM (µs),Force (Kg f),Voltage (V)", KGF),
        ("Pulse_us,Thrust [lbf],Supply (V)", LBF),
        ("PWM, Voltage (V),Thrust (lb f)", LBF),
        ("PWM (us),Force (N),Voltage", 1.0),
        ("PWM (us),Force (lbs),Force (N),Voltage", LBF),
        ("PWM (us),Thrust (g),Voltage", 1e-3 * KGF),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8-sig", "latin-1"])
def test_csv_of_several_voltages_in_any_unit(tmp_path: Path, header: str, newtons: float, encoding: str) -> None:
    lines = [header]
    for volts, half_us, full_N in SHEETS[:2]:
        for index, (pulse, force) in enumerate(zip(PULSES, measured(half_us, full_N), strict=True)):
            cells = {"P": pulse, "V": volts - 0.1 * (index % 3), "S": volts - 0.1 * (index % 3)}
            lines.append(
                ",".join(
                    str(
                        cells[name.strip()[0].upper()]
                        if not name.strip().startswith(("Force", "Thrust"))
                        else force / newtons
                    )
                    for name in header.split(",")
                )
            )
    file = tmp_path / "thruster.csv"
    file.write_bytes("\n".join(lines).encode(encoding))
    assert is_published(file)
    sheets = sheets_of(file)
    assert [sheet.supply_V for sheet in sheets] == pytest.approx([9.9, 11.9])
    assert sheets[1].force_N == pytest.approx(measured(36.0, 36.4), abs=1e-9)


def test_what_names_no_voltage_asks_for_it(tmp_path: Path) -> None:
    file = tmp_path / "thruster.csv"
    file.write_text("PWM,Force (kgf)\n1100,-2\n1900,3\n", encoding="utf-8")
    with pytest.raises(HindraxError, match="found no voltage; give it with --supply V"):
        sheets_of(file)
    (sheet,) = sheets_of(file, 12.0)
    assert sheet.supply_V == 12.0
    assert sheet.force_N.tolist() == pytest.approx([-2 * KGF, 3 * KGF])


def test_what_is_no_data_is_refused_by_name(tmp_path: Path, workbook: Path) -> None:
    broken = tmp_path / "broken.xlsx"
    broken.write_bytes(workbook.read_bytes()[:4000])
    with pytest.raises(UsageError, match=r"broken.xlsx: is no workbook"):
        sheets_of(broken)
    with pytest.raises(UsageError, match="cannot be read"):
        sheets_of(tmp_path / "none.xlsx")
    book = new_workbook()
    empty = tmp_path / "empty.xlsx"
    book.save(empty)
    with pytest.raises(HindraxError, match="found no sheet with PWM"):
        sheets_of(empty)
    sweep = tmp_path / "sweep.csv"
    sweep.write_text("pulse_us,load_N\n1100,-3\n", encoding="utf-8")
    assert not is_published(sweep)
    twice = tmp_path / "twice.csv"
    twice.write_text("PWM,Force (N)\n1100,-2\n1900,3\n", encoding="utf-8")
    assert len(sheets_of(twice, 12.0)) == 1


def test_a_workbook_without_openpyxl_names_both_ways_to_it(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(HindraxError, match=r"need openpyxl; .*pip install \"hindrax\[workbook\]\"; or save"):
        sheets_of(tmp_path / "thruster.xlsx")


def test_noise_does_not_make_thrust_fall() -> None:
    force = law(PULSES, 30.0, 40.0) + np.random.default_rng(3).normal(0.0, 0.4, PULSES.size)
    found = measured_table([Sheet(14.8, PULSES, array(np.where(np.abs(PULSES - 1500.0) <= 30.0, 0.0, force)))])
    assert found.table.problems(1500.0) == []
    assert found.residual_N < 0.6


def test_a_sweep_of_the_wrong_sign_or_of_one_side_is_refused() -> None:
    with pytest.raises(HindraxError, match=r"14 V: thrust does not grow with the pulse; change the sign"):
        measured_table([Sheet(14.0, PULSES, -law(PULSES, 30.0, 40.0))])
    half = PULSES[PULSES > 1500.0]
    with pytest.raises(HindraxError, match="wanted both sides of 1500"):
        measured_table([Sheet(14.0, half, law(half, 30.0, 40.0))])


PUSHING = np.array([1100.0, 1200.0, 1400.0, 1475.0, 1525.0, 1600.0, 1800.0, 1900.0])
"""Pulses that all push: nothing of the dead band was measured."""


@pytest.mark.parametrize(
    ("dead_band_us", "ends"), [(None, (1476.0, 1524.0)), (10.0, (1490.0, 1510.0)), (30.0, (1470.0, 1530.0))]
)
def test_a_sweep_without_zeros_has_the_dead_band_of_its_controller_or_the_one_named(
    dead_band_us: float | None, ends: tuple[float, float]
) -> None:
    """It ends a microsecond before the first pulse that pushes; what pushes in a band that is named is left out."""
    force = array(0.04 * (PUSHING - 1500.0))
    found = measured_table([Sheet(14.8, array(PUSHING), force)], dead_band_us=dead_band_us)
    assert found.dead_us == (ends,)
    assert found.residual_N < 0.01
    (row,) = found.table.force_N
    within = [value for pulse, value in zip(found.table.pulse_us, row, strict=True) if ends[0] <= pulse <= ends[1]]
    assert len(within) == 3
    assert not any(within)
