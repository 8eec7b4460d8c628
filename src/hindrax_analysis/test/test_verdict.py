"""The last screen of a result: a line a motion, and one next experiment with what it buys."""

from dataclasses import replace

import numpy as np
import pytest

from hindrax_analysis.identification.verdict import show_next, show_verdicts
from hindrax_core.text.digits import TWO_SIDED_95
from hindrax_ident.assess.assessment import FLY_TWICE
from hindrax_ident.assess.results import DragBand, MotionResult, NextStep

SPEED, FORCE, STD = np.array([0.1, 0.4]), np.array([1.0, 20.0]), np.array([0.5, 2.0])
SURGE = MotionResult(
    "surge",
    "online",
    {},
    identifiable=True,
    drag=DragBand(SPEED, FORCE, 0.1 * STD, STD),
    quality={"held_out_rmse": 0.013, "held_out_rmse_stays_still": 0.24},
    next_step=NextStep(FLY_TWICE, 1.5),
)
SWAY = replace(
    SURGE,
    motion="sway",
    identifiable=False,
    drag=DragBand(SPEED, FORCE, STD, 3.0 * STD),
    quality={},
    next_step=NextStep("wait until the water is still", 4.0),
)


def rows(printed: str) -> list[list[str]]:
    return [
        [cell.strip() for cell in line.strip("\u2502").split("\u2502")]
        for line in printed.splitlines()
        if line.startswith("\u2502")
    ]


def test_each_motion_has_a_line_with_the_interval_and_the_held_out_error(capsys: pytest.CaptureFixture[str]) -> None:
    show_verdicts({"surge": SURGE}, {})
    low, high = 20.0 - TWO_SIDED_95 * 2.0, 20.0 + TWO_SIDED_95 * 2.0
    wanted = ["surge", "20.0 N at 0.4 m/s", f"{low:.1f} to {high:.1f}", "10%", "0.013 (0.24)"]
    assert rows(capsys.readouterr().out) == [wanted]
    show_verdicts({"surge": SURGE, "sway": SWAY}, {"surge": 0.12})
    surge, sway = rows(capsys.readouterr().out)
    assert surge == [*wanted[:4], "12%", wanted[4], "yes"]
    assert sway[3:] == ["30%", "", "", "no"]


def test_what_has_no_drag_has_no_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    show_verdicts({"surge": replace(SURGE, drag=None, quality={})}, {})
    assert rows(capsys.readouterr().out)[0][0] == "surge"
    show_verdicts({}, {})
    show_next({"surge": replace(SURGE, drag=None)}, [])
    show_next({}, ["./hindrax"])
    assert capsys.readouterr().out == ""


def test_the_next_experiment_is_that_of_the_worst_motion_and_states_what_it_buys(
    capsys: pytest.CaptureFixture[str],
) -> None:
    show_next({"surge": SURGE, "sway": SWAY}, ["./hindrax", "pool-test"])
    assert capsys.readouterr().out == (
        "next: wait until the water is still; the drag of sway would be known to 20.0% instead of 30.0%\n"
    )
    still = replace(SWAY, drag=DragBand(SPEED, FORCE, STD, 900.0 * STD))
    show_next({"surge": SURGE, "sway": still}, [])
    assert "the drag of surge would be known" in capsys.readouterr().out, "sway hardly moved"
    show_next({"heave_down": replace(SURGE, motion="heave_down")}, ["./hindrax", "pool-test", "--mock"])
    printed = capsys.readouterr().out.splitlines()
    assert printed[0] == f"next: {FLY_TWICE}; the drag of heave_down would be known to 7.5% instead of 10.0%"
    assert printed[1:] == ["  ./hindrax pool-test --mock --dof heave"]
