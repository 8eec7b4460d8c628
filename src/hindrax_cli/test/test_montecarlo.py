"""Many runs: the table against numbers made by hand, the executors against each other, the command over the mock."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from hindrax_analysis.identification.executor import Workers, run_all
from hindrax_analysis.identification.montecarlo import (
    CoefficientError,
    DragError,
    Trial,
    by_chance,
    drag_bias,
    summary,
    tabulate,
)
from hindrax_cli.command_line import main
from hindrax_cli.commands.explain.trials import print_montecarlo
from hindrax_core import errors
from hindrax_core.errors import HindraxError


def trial(seed: int, error: float, std: float = 1.0) -> Trial:
    refined = CoefficientError("surge", "k_q", "output-error", error, std, 0.5, 66.48)
    other = CoefficientError("surge", "k_q", "rls", 2.0 * error, std, 0.5, 66.48)
    return Trial(seed, (refined, other), (DragError("surge", 1.0, 0.01 * error),))


def test_cells_are_the_moments_of_the_errors() -> None:
    cells = {cell["method"]: cell for cell in tabulate([trial(1, 1.0), trial(2, -2.0), trial(3, 4.0)])}
    cell = cells["output-error"]
    assert cell["bias"] == pytest.approx(1.0)
    assert cell["rmse"] == pytest.approx(math.sqrt(7.0))
    assert cell["crlb"] == pytest.approx(0.5)
    assert cell["ratio"] == pytest.approx(2.0 * math.sqrt(7.0))
    assert cell["coverage95"] == pytest.approx(1.0 / 3.0)
    assert cells["rls"]["rmse"] == pytest.approx(2.0 * cell["rmse"])
    assert drag_bias([trial(1, 1.0), trial(2, -2.0)])[0]["bias"] == pytest.approx(-0.005)


def test_chance_alone_scatters_ratios() -> None:
    # Quantiles of chi-squared with 40 degrees of freedom, from any table: 24.43 and 59.34.
    assert by_chance(40) == pytest.approx((math.sqrt(24.433 / 40.0), math.sqrt(59.342 / 40.0)), rel=1e-4)


def test_summary_has_the_shape_of_the_command_line() -> None:
    document = summary([trial(1, 1.0), Trial(2, (), (), "altitude: too low")])
    assert document["runs"] == 2
    assert document["ratio_by_chance"] == list(by_chance(2))
    assert set(document["cells"][0]) >= {"motion", "coefficient", "bias", "rmse", "crlb", "ratio", "coverage95"}
    assert [cell["method"] for cell in document["cells"]] == ["output-error"]
    assert document["troubles"] == {"2": "altitude: too low"}
    json.dumps(document)


@pytest.mark.parametrize("workers", [1, 2], ids=["here", "processes"])
def test_results_come_in_the_order_of_the_items(workers: int) -> None:
    assert list(run_all(math.factorial, range(7), workers=workers)) == [1, 1, 2, 6, 24, 120, 720]


@pytest.mark.parametrize("workers", [1, 2], ids=["here", "processes"])
def test_what_goes_wrong_in_a_worker_is_raised_here(workers: int) -> None:
    with pytest.raises(ValueError, match="negative"):
        list(run_all(math.factorial, [1, -1, 2], workers=workers))


def test_a_worker_that_is_killed_is_one_sentence() -> None:
    """As by a machine without free memory: it was a traceback of the pool."""
    with pytest.raises(HindraxError, match=r"a process that computed was killed, .* `--workers 1`"):
        list(run_all(signal.raise_signal, [signal.SIGKILL, signal.SIGKILL], workers=2))


def test_one_worker_needs_no_process() -> None:
    here, ours = "/proc/self", str(os.getpid())
    assert list(run_all(os.readlink, [here], workers=1)) == [ours]
    assert ours not in list(run_all(os.readlink, [here]))


def test_the_command_flies_and_compares(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["montecarlo", "--runs", "1", "--dof", "yaw", "--workers", "1", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    cells = {cell["coefficient"]: cell for cell in document["cells"]}
    assert set(cells) == {"k_q", "k_l", "b", "added_mass"}
    # One run: three and a half bounds are more than chance allows.
    assert all(cell["ratio"] < 3.5 for cell in cells.values())
    assert all(abs(row["bias"]) < 0.02 for row in document["drag"])


INTERRUPTED = """
import time
from hindrax_analysis.identification.executor import Workers, run_all
if __name__ == "__main__":
    try:
        print("starting", flush=True)
        for _ in run_all(time.sleep, [0.0, *[60.0] * 40], workers=2):
            print("working", flush=True)
    except KeyboardInterrupt:
        print("interrupted")
"""


@pytest.mark.parametrize(("moment", "later_s"), [*(("starting", 0.05 * later) for later in range(8)), ("working", 0.0)])
def test_ctrl_c_ends_the_workers_without_a_word_of_their_own(moment: str, later_s: float, tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(INTERRUPTED, encoding="utf-8")
    with subprocess.Popen(
        [sys.executable, str(script)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as child:
        assert child.stdout is not None
        while child.stdout.readline() != f"{moment}\n":
            pass
        time.sleep(later_s)  # they are being started, begin, or wait for work
        os.killpg(child.pid, signal.SIGINT)
        printed, complaints = child.communicate(timeout=50.0)
    assert complaints == ""
    assert printed.endswith("interrupted\n")


@pytest.mark.parametrize("done", [2, 0])
def test_ctrl_c_after_hours_shows_the_runs_that_are_done(
    done: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(_workers: Workers, jobs: Sequence[object]) -> Iterator[Trial]:
        yield from (trial(seed, 1.0) for seed in range(1, done + 1))
        assert len(jobs) > done
        raise KeyboardInterrupt

    monkeypatch.setattr(Workers, "run", interrupted)
    assert main(["montecarlo", "--runs", "5", "--dof", "surge", "--json"]) == errors.INTERRUPTED
    shown = capsys.readouterr().out
    assert (json.loads(shown)["runs"] if done else shown) == (done or "")


def test_the_whole_table_says_whose_bound_that_of_the_live_estimate_is(capsys: pytest.CaptureFixture[str]) -> None:
    print_montecarlo(summary([trial(1, 1.0), trial(2, -2.0)]), whole=True)
    assert (
        "the bound of rls is that of an estimate that does not know the delays of the thrust" in capsys.readouterr().out
    )
