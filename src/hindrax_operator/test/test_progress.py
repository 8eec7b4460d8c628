"""What a pool test shows while it flies: the maneuver, and what is known of the motion by now."""

import io
import math
import os
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console

from hindrax_core.events import Stamp, Stamped
from hindrax_core.signals import Estimate
from hindrax_core.text.digits import IN_FLIGHT
from hindrax_operator.progress import Progress, panel

SURGE = Estimate(
    "surge", ("k_q", "k_l"), ("N s^2/m^2", "N s/m"), (66.1, 1.3), ((0.16, 0.0), (0.0, 0.25)), 120, 80.0, True, ""
)
FLOWN = {
    "motion": "surge",
    "phase": "plateau",
    "force": 9.5,
    "velocity": 0.31,
    "progress": 0.42,
    "remaining": 61.0,
    "wall_distance": 3.2,
}


def flown(**changes: str | float) -> Any:
    return SimpleNamespace(**(FLOWN | changes))


def shown(estimates: dict[str, Any], **changes: str | float) -> str:
    console = Console(width=120)
    with console.capture() as captured:
        console.print(panel(flown(**changes), None, estimates))
    return captured.get()


def headless(
    capsys: pytest.CaptureFixture[str], estimates: dict[str, Stamped[Estimate]], **changes: str | float
) -> str:
    with Progress(headless=True) as progress:
        progress.show(flown(**changes), None, estimates)
    return capsys.readouterr().err.rstrip().partition("s] ")[2]


def test_a_full_disk_below_the_lines_does_not_end_the_flight(monkeypatch: pytest.MonkeyPatch) -> None:
    with Path("/dev/full").open("w") as full:
        monkeypatch.setattr(sys, "stderr", full)
        with Progress(headless=True) as progress:
            progress.report("armed; flying surge")
        monkeypatch.undo()
        os.dup2(os.open(os.devnull, os.O_WRONLY), full.fileno())


def test_without_a_terminal_every_plateau_has_a_line_with_what_is_known(capsys: pytest.CaptureFixture[str]) -> None:
    known = {"surge": Stamped(Stamp(0), SURGE)}
    line = "surge: plateau at +9.5 N, 42 %, 61 s to go, wall 3.2 m ahead"
    assert headless(capsys, {}) == line
    meaning, _, told = headless(capsys, known).partition("\n")
    assert meaning == IN_FLIGHT
    assert told.partition("] ")[2] == f"{line}; k_q 66.10 +- 0.40 N s^2/m^2  k_l 1.30 +- 0.50 N s/m  (120 samples)"


def test_an_estimate_has_the_digits_that_its_deviation_leaves_it(capsys: pytest.CaptureFixture[str]) -> None:
    wild = replace(SURGE, values=(213.2, -44.89), covariance=((104.38**2, 0.0), (0.0, 38.12**2)))
    printed = headless(capsys, {"surge": Stamped(Stamp(0), wild)})
    assert printed.endswith("; k_q 213 +- 104 N s^2/m^2  k_l -45 +- 38 N s/m  (120 samples)")


def test_before_its_first_sample_an_estimate_is_only_the_prior_and_not_shown(
    capsys: pytest.CaptureFixture[str],
) -> None:
    prior = replace(SURGE, samples=0, learning=False, reason="phase settle")
    assert headless(capsys, {"surge": Stamped(Stamp(0), prior)}).endswith("; nothing learned yet: phase settle")


def test_a_turn_is_in_newton_meters_and_an_unknown_wall_is_not_given(capsys: pytest.CaptureFixture[str]) -> None:
    line = headless(capsys, {"surge": Stamped(Stamp(0), SURGE)}, motion="yaw", wall_distance=math.nan)
    assert line == "yaw: plateau at +9.5 N m, 42 %, 61 s to go"
    assert "+9.5 N m, +0.310 rad/s, 61 s of vehicle time to go" in shown({}, motion="yaw", wall_distance=math.nan)


def test_the_live_view_is_gone_when_the_flight_is_over(monkeypatch: pytest.MonkeyPatch) -> None:
    written = io.StringIO()
    monkeypatch.setattr(sys, "stderr", written)
    monkeypatch.setattr(written, "isatty", lambda: True)
    monkeypatch.setenv("TERM", "xterm")
    with Progress(headless=False) as progress:
        progress.show(flown(), None, {})
        progress.end_view()
        progress.report("identifying")
    view, erase_line, last = written.getvalue().rpartition("\x1b[2K")
    assert "plateau" in view
    assert erase_line, "the view is erased"
    assert "identifying" in last
    assert "plateau" not in last


def test_the_live_view_shows_every_motion_known() -> None:
    found = shown({"surge": Stamped(Stamp(0), SURGE)})
    assert "+9.5 N, +0.310 m/s, wall 3.2 m ahead, 61 s of vehicle time to go" in found
    assert "k_q 66.10 +- 0.40" in found
