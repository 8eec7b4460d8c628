"""The golden cells: printed numbers of the five papers that must come out, and the misprints that must be found."""

import functools

import pytest

from hindrax_laboratory.papers import recompute
from hindrax_laboratory.papers.cells import Cell

# Every worker of a parallel run imports this file, and one of them runs it.
all_cells = functools.cache(recompute)


def find(paper: str, table: str, row: str, quantity: str) -> Cell:
    hits = [
        c
        for c in all_cells()
        if (c.paper, c.table) == (paper, table) and c.row.startswith(row) and c.quantity.startswith(quantity)
    ]
    assert len(hits) == 1, (paper, table, row, quantity, len(hits))
    return hits[0]


@pytest.mark.parametrize(
    ("row", "printed"),
    [("surge 4", 0.4401), ("sway 5", 0.7132), ("heave 6", 0.8260), ("heave 25 mm, k = 1127.7", 0.8287)]
    + [
        (f"heave {a} mm, k = 659.9", m)
        for a, m in ((20, 0.8198), (25, 0.8179), (30, 0.8220), (35, 0.8229), (40, 0.8197), (45, 0.8187))
    ],
)
def test_added_mass_by_free_oscillation_within_a_gram(row: str, printed: float) -> None:
    cell = find("B", "4", row, "m_ad (5)")
    assert cell.recomputed == pytest.approx(printed, abs=0.001)
    assert (cell.printed, cell.verdict) == (printed, "agrees")


def test_the_swapped_digits_of_the_heave_row_are_found() -> None:
    cell = find("B", "4", "heave 20 mm, k = 1127.7", "m_ad (5)")
    assert cell.recomputed == pytest.approx(0.8355, abs=5e-5)
    assert cell.verdict == "misprint"
    assert "30.2136" in cell.note


def test_damping_of_the_soft_springs_follows_the_undamped_formula() -> None:
    rows = [c for c in all_cells() if c.paper == "B" and "659.9" in c.row and c.quantity.startswith("c (6)")]
    assert len(rows) == 6
    assert {c.verdict for c in rows} == {"does not follow"}
    assert all("follows with m_ad of (7)" in c.note for c in rows)


@pytest.mark.parametrize(("direction", "mass"), [("surge", 12.08), ("sway", 19.43), ("heave", 22.48)])
def test_prototype_added_mass(direction: str, mass: float) -> None:
    cell = find("B", "6", direction, "prototype")
    assert cell.recomputed == pytest.approx(mass, abs=0.01)
    assert cell.verdict == "agrees"


def test_heave_mean_and_deviation() -> None:
    assert find("B", "4", "heave, mean", "mean").recomputed == pytest.approx(0.8227, abs=5e-5)
    assert find("B", "4", "heave, mean", "standard").recomputed == pytest.approx(0.0042, abs=5e-5)


@pytest.mark.parametrize(
    ("motion", "expected"),
    [
        ("surge", 2.28),
        ("sway", 3.84),
        ("heave, positive", 3.56),
        ("heave, negative", 2.63),
        ("roll", 0.032),
        ("pitch", 0.018),
        ("yaw", 0.051),
    ],
)
def test_drag_coefficients_of_the_hindrax(motion: str, expected: float) -> None:
    cell = find("A", "4", motion, "C_D")
    assert cell.recomputed == pytest.approx(expected, rel=0.03 if expected < 0.1 else 2e-3)
    assert cell.verdict == ("does not follow" if motion in ("roll", "pitch") else "agrees")


def test_the_positive_thrust_row_cannot_be_a_thrust_curve() -> None:
    cell = find("A", "2", "positive", "thrust at the stop")
    assert cell.recomputed == pytest.approx(-1070, abs=1.0)
    assert cell.verdict == "does not follow"
    assert "none of" in cell.note
    assert find("A", "2", "negative", "thrust at the stop").verdict == "agrees"


def test_planar_motion_tables_agree() -> None:
    cells = [c for c in all_cells() if c.paper == "C"]
    assert len(cells) == 14
    assert {c.verdict for c in cells} == {"agrees"}
    assert find("C", "asymmetry", "|Z_qdot", "ratio").recomputed == pytest.approx(2.11, abs=0.005)


@pytest.mark.parametrize(
    ("table", "vehicle", "printed", "relative"),
    [
        ("added mass", "Neptunus", (1.926, 18.840, 5.993, 0.014, 0.052, 0.091), 0.01),
        ("quadratic drag, article", "Neptunus", (12.459, 83.2442, 19.2536, 0.0220, 0.0552, 0.1698), 0.002),
        ("quadratic drag", "SF-30k", (792.7, 1093.6, 1974.2, 275.4, 943.6, 572.1), 0.0005),
        ("added mass", "LBV600-6", (10.6322, 23.5517, 32.7863, 0.0719, 0.2925, 0.2736), 0.035),
        ("quadratic drag", "LBV600-6", (29.6028, 55.9146, 83.0852, 0.0773, 0.4091, 0.2931), 0.012),
    ],
)
def test_empirical_estimate_of_three_vehicles(
    table: str, vehicle: str, printed: tuple[float, ...], relative: float
) -> None:
    cells = [c for c in all_cells() if (c.paper, c.table, c.row) == ("D", table, vehicle)]
    assert tuple(c.printed for c in cells) == printed
    for cell in cells:
        # The smallest added inertias are printed with two digits: half a unit of the last one is 3.6 %.
        assert abs(cell.recomputed - cell.printed) <= max(
            relative * cell.printed, 0.0005 if "Neptunus" in vehicle else 0.0
        )
        assert cell.verdict == "agrees"


def test_misprints_of_the_thesis_are_named_by_their_correction() -> None:
    drag = find("D", "quadratic drag, thesis", "Neptunus", "quadratic drag heave")
    assert (drag.printed, drag.verdict) == (16.2536, "misprint")
    assert "19.2536" in drag.note
    prism = [c for c in all_cells() if c.table == "added mass, prism 0.13 as in the text" and c.verdict == "misprint"]
    assert prism
    assert all("0.14 printed as 0.13" in c.note for c in prism)


def test_cfd_drag_is_exactly_62_and_0_4_not_what_the_paper_fitted() -> None:
    linear = find("E", "5", "least squares", "K_L")
    quadratic = find("E", "5", "least squares", "K_Q")
    assert linear.recomputed == pytest.approx(62.0, abs=1e-9)
    assert quadratic.recomputed == pytest.approx(0.4, abs=1e-9)
    assert {linear.verdict, quadratic.verdict} == {"does not follow"}
    assert {c.verdict for c in all_cells() if c.paper == "E" and c.quantity == "drag"} == {"agrees"}
