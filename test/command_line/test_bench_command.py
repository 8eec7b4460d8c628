"""The table of `hindrax bench`, without measuring anything."""

import importlib
import sys

import pytest

from hindrax_bringup import clone
from hindrax_cli.command_line import main
from hindrax_cli.commands.explain.trials import print_bench
from hindrax_tools.benchmarks.stack import TICK_us, row


def test_a_vehicle_without_the_peers_gets_a_sentence(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(clone, "is_vehicle_setup", lambda: True)
    monkeypatch.setitem(sys.modules, "padasip", None)  # importing it then raises ModuleNotFoundError
    monkeypatch.delitem(sys.modules, "hindrax_tools.benchmarks.rls", raising=False)
    assert main(["bench", "rls"]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert (
        lines[-1]
        == "hindrax bench: this is the set-up of a vehicle, without padasip; `./hindrax setup --all` installs it"
    )
    monkeypatch.setattr(clone, "is_vehicle_setup", lambda: False)
    with pytest.raises(ModuleNotFoundError):
        main(["bench", "rls"])


def test_a_long_time_is_a_number_and_not_an_exponent(capsys: pytest.CaptureFixture[str]) -> None:
    print_bench([{"name": "surge run", "ours_us": 368_912.4, "peer_us": 1e6, "ratio": 2.7106, "peer": "real time"}])
    print_bench([{"name": "settled in 5.3 s", "ratio": 0.0965, "peer": "without the model"}])
    printed = capsys.readouterr().out
    for words in ("369000", "1000000", "2.71", "0.0965", "without the model"):
        assert words in printed
    assert "e+" not in printed


def test_a_process_that_took_no_time_is_not_so_many_times_faster(capsys: pytest.CaptureFixture[str]) -> None:
    found = [row(name, us, 20.0, "a node", 3e5) for name, us in (("supervisor", 0.0), ("sensors", 100.0 * TICK_us))]
    assert found[0]["ratio"] is None
    assert found[1]["ratio"] == pytest.approx(3e3 / TICK_us)
    print_bench(found)
    line = next(one for one in capsys.readouterr().out.splitlines() if "supervisor" in one)
    assert [cell.strip() for cell in line.split("\u2502")[1:4]] == ["0", "300000", ""]


def test_what_a_benchmark_starts_as_a_process_of_a_stack_has_a_main() -> None:
    """A package has none: the load of the recorder did not come up, and nobody saw it."""
    pytest.importorskip("rclpy", reason="needs the ROS environment")
    recording = importlib.import_module("hindrax_tools.benchmarks.recording")
    assert callable(importlib.import_module(recording.LOAD.module).main)
