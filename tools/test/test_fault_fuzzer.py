"""The fuzzer of faults: a case is a line, a finding is shrunk to what it needs, and kept cases stay mended."""

import random
from collections.abc import Sequence

import pytest

from hindrax_bringup.share_files import default_vehicle, vehicle_file
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import load_vehicle
from hindrax_sim.faults.fault_registry import FAULTS
from hindrax_sim.hardware import TrueState
from hindrax_tools import fault_fuzzer
from hindrax_tools.fault_fuzzer import (
    EVERY_MODE,
    KEPT_CASES,
    OUTPUT,
    FaultCase,
    drawn,
    flown_by_bytes,
    kinds,
    main,
    shrunk,
    violations,
)
from hindrax_tools.faults.device_faults import Watched
from hindrax_tools.faults.fault_outcome import Judge

LINE = "hindrax hold 7 depth_stuck:ms5837@15.3+9999 thruster_fails:T3@16.2+1 garbage:dvl75@14.9+0.1"
JUDGE = Judge(TrueState(30.0, (0.0,) * 3, (0.0,) * 3, 0.8, 0, (3.0, 1.5), (1600.0, 1500.0)))


def test_a_case_is_a_line_and_back() -> None:
    case = FaultCase.parse(LINE)
    assert (case.vehicle, case.mode, case.seed, len(case.faults)) == ("hindrax", "hold", 7, 3)
    assert str(case) == LINE


@pytest.mark.parametrize(
    "line", ["", "hindrax hold seven leak:hull@1+1", "hindrax dance 1 leak:hull@1+1", "hindrax hold 1"]
)
def test_what_is_no_case_is_named(line: str) -> None:
    with pytest.raises(UsageError, match="wanted"):
        FaultCase.parse(line)


def test_draws_are_pairs_and_triples_of_faults_that_fall_on_the_vehicle_and_come_again_with_the_seed() -> None:
    vehicle = load_vehicle(default_vehicle())
    cases = [drawn({"hindrax": vehicle}, random.Random(seed)) for seed in range(200)]
    assert cases[:9] == [drawn({"hindrax": vehicle}, random.Random(seed)) for seed in range(9)]
    assert {len(one.faults) for one in cases} == {2, 3}
    assert {one.mode for one in cases} == set(EVERY_MODE)
    for fault in (one for case in cases for one in case.faults):
        assert fault.devices[0] in FAULTS[fault.name].devices(vehicle)
        assert fault.devices[0] != OUTPUT
    assert all(FaultCase.parse(str(one)) == one for one in cases)


def test_a_finding_is_shrunk_to_the_fault_that_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    flown: list[str] = []

    def flies(case: FaultCase) -> Sequence[str]:
        flown.append(str(case))
        stuck = any(one.name == "depth_stuck" for one in case.faults)
        return (f"thrust for {len(flown)} s on a state that is wrong",) if stuck else ()

    monkeypatch.setattr(fault_fuzzer, "violations", flies)
    assert str(shrunk(FaultCase.parse(LINE))) == "hindrax hold 0 depth_stuck:ms5837@15+9999"
    assert kinds(["thrust for 0.71 s"]) == kinds(["thrust for 1.2 s"]) != kinds(["tilted by 50 deg"])


def test_a_defect_of_the_code_is_a_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    def fails(*_: object) -> None:
        raise ZeroDivisionError("of the pilot")

    monkeypatch.setattr(fault_fuzzer, "watched", fails)
    assert violations(FaultCase.parse(LINE)) == ("defect: ZeroDivisionError: of the pilot",)


@pytest.mark.parametrize(
    ("found", "violated"),
    [
        (Watched(JUDGE, thrust=True), "it flies on without power, and nobody is told"),
        (Watched(JUDGE, "no thruster moves it", thrust=True), ""),
        (Watched(JUDGE, "sinking: too deep", exit_code=0), "it ended with 0, though sinking: too deep"),
        (Watched(JUDGE, "sinking: too deep", exit_code=1, told=("report",)), ""),
    ],
)
def test_silence_and_a_good_exit_code_are_findings(
    found: Watched, violated: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(fault_fuzzer, "watched", lambda *_: found)
    monkeypatch.setattr(Judge, "flies_on", True)
    assert violations(FaultCase.parse("bluerov2-heavy maneuver 0 supply_dies:supply@30+9999")) == (violated,) * bool(
        violated
    )


def test_a_vehicle_behind_an_autopilot_flies_with_the_electronics_of_our_own() -> None:
    heavy = flown_by_bytes(vehicle_file("bluerov2-heavy"))
    assert (heavy.output.device, heavy.name) == ("pca9685", "bluerov2-heavy")
    assert heavy.thrusters == load_vehicle(vehicle_file("bluerov2-heavy")).thrusters


def test_the_command_prints_findings_and_ends_with_1(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(fault_fuzzer, "violations", lambda _: ("it ended, and nobody is told why",))
    assert main(["--repeat", LINE]) == 1
    monkeypatch.setattr(
        fault_fuzzer, "fuzzed", lambda *_: [(FaultCase.parse(LINE), ("it ended",)), (FaultCase.parse(LINE), ())]
    )
    monkeypatch.setattr(fault_fuzzer, "shrunk", lambda case: case)
    assert main(["--minutes", "1"]) == 1
    out = capsys.readouterr().out
    assert f"{LINE}\n  it ended\n" in out
    assert out.endswith("2 flights, 1 findings\n")
    with pytest.raises(SystemExit):
        main(["--repeat", "nothing"])


@pytest.mark.parametrize("line", KEPT_CASES.read_text(encoding="ascii").splitlines())
def test_what_was_found_and_mended_is_not_violated_again(line: str) -> None:
    assert violations(FaultCase.parse(line)) == ()
