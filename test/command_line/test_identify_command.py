"""`identify` over CSV records: all options, no confidence without cause."""

import json
import math
import re
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from identify_desk import START_S, TRUTH, Desk, as_csv, desk, flown, is_true

from hindrax_analysis import api
from hindrax_analysis.coefficients_file import read_coefficients
from hindrax_bag.read.recovery import recover
from hindrax_bringup.clone import clone_root
from hindrax_cli.command_line import main
from hindrax_cli.commands.data import identify
from hindrax_core.errors import UsageError
from hindrax_core.topics import MANEUVER, resolved
from hindrax_core.vehicle import load_vehicle
from hindrax_ident.arrays import array
from hindrax_ident.assess.joint_assessment import JointMotion, JointResults
from hindrax_ident.assess.objections import Code, Objection
from hindrax_ident.assess.results import DragBand, Number

__all__ = ["desk"]
"""A fixture of all tests."""

# ---- CSV


def test_csv_gives_the_truth_with_the_smallest_vehicle_file(desk: Desk) -> None:
    document = desk.of_small(desk.csv())
    surge = document["motions"]["surge"]
    assert surge["identifiable"]
    assert is_true(surge)
    assert (document["aborted"], document["aborted_by"]) == (None, None)
    assert document["report"] is None
    assert set(document["motions"]) == {"surge"}


def test_the_library_is_as_unsure_as_the_command(desk: Desk) -> None:
    """It took the force of a file that nobody had calibrated for exact: its intervals missed a gain of 1.15."""
    told, vehicle = desk.surge(file := desk.csv()), api.load_vehicle(desk.small)
    for gain_sigma, same in ((None, True), (0.1, True), (0.02, False)):
        found = api.identify(file, vehicle=vehicle, gain_sigma=gain_sigma).motions["surge"].coefficients
        for name in ("k_q", "k_l", "added_mass"):
            assert found[name].value == pytest.approx(told[name]["value"])
        assert (found["k_q"].std_calibrated == pytest.approx(told["k_q"]["std_calibrated"])) == same


def test_a_report_and_a_file_are_left_where_asked(desk: Desk) -> None:
    page, file = desk.folder / "a.html", desk.folder / "a.yaml"
    words = [desk.csv(), "--vehicle", desk.small, "--report", page, "--coefficients", file]
    document = desk.identified(*words)
    assert document["report"] == str(page)
    assert "Online estimate of k_q" in page.read_text()
    assert "small" in file.read_text()


def test_the_table_states_what_is_known_and_what_is_not(desk: Desk) -> None:
    record = desk.csv(levels=(0.3, 0.5), noise=0.003)
    assert main(["identify", str(record), "--vehicle", str(desk.small)]) == 0
    printed = desk.capsys.readouterr().out
    assert "* surge: not identifiable" in printed
    assert re.search(r"surge\* .* 0\.\d+ N at 0\.\d+ m/s .* 0\.\d+ to 0\.\d+ ", printed)
    assert "estimated delays" not in printed
    assert "COB-2023" not in printed


def test_the_delays_of_an_identified_motion_are_said(desk: Desk) -> None:
    assert main(["identify", str(desk.csv()), "--vehicle", str(desk.small)]) == 0
    printed = desk.capsys.readouterr().out
    assert re.search(r"surge: estimated delays: thrust 0\.\d\d s; velocity stamps 0\.\d\d s too (late|early)", printed)


def test_a_part_of_a_record_is_taken(desk: Desk) -> None:
    whole, part = desk.surge(desk.csv()), desk.surge(desk.csv(), "--from", 15, "--to", 65)
    assert part["samples"] < 0.8 * whole["samples"]
    assert is_true(part)


def test_a_dvl_without_lock_is_reported_and_leaves_the_truth(desk: Desk) -> None:
    (t, v), forces = flown()
    for begin_s in (7.0, 22.0, 50.0):
        v = np.where((t > begin_s) & (t < begin_s + 4.0), 0.0, v)
    found = desk.of_small(as_csv(desk.folder / "lost.csv", (t, v), forces))
    assert any("exactly 0 in motion" in one for one in found["assumptions"])
    assert found["motions"]["surge"]["identifiable"]
    assert is_true(found["motions"]["surge"])


def test_one_file_per_topic_is_one_record(desk: Desk) -> None:
    velocities, forces = flown()
    files = []
    for name, header, (t, values) in (
        ("odometry", "field.twist.twist.linear.x", velocities),
        ("thrust", "field.wrench.force.x", forces),
    ):
        files.append(desk.folder / f"{name}.csv")
        rows = [f"{round(1e9 * (START_S + at))},{value:.6f}" for at, value in zip(t, values, strict=True)]
        files[-1].write_text("\n".join([f"%time,{header}", *rows]))
    apart = desk.of_small(*files)
    together = desk.of_small(as_csv(desk.folder / "one.csv", velocities, forces))
    k_q, alone = (one["motions"]["surge"]["k_q"]["value"] for one in (together, apart))
    assert alone == pytest.approx(k_q, 1e-3)
    assert "runs" not in apart
    assert "holds velocities alone" in desk.refused(files[0], files[0], "--vehicle", desk.small)
    assert desk.refused(files[0], "--vehicle", desk.small)


def test_coefficients_predict_a_record_that_they_were_not_fitted_to(desk: Desk) -> None:
    fitted, fresh = desk.csv(), as_csv(desk.folder / "fresh.csv", *flown(seed=3, noise=0.02))
    file, plot = desk.folder / "coefficients.yaml", desk.folder / "fresh.svg"
    desk.of_small(fitted, "--coefficients", file)
    assert main(["predict", str(file), str(fresh), "--vehicle", str(desk.small), "--plot", str(plot), "--json"]) == 0
    printed = desk.capsys.readouterr()
    assert "another vehicle" not in printed.err
    surge = json.loads(printed.out)["motions"]["surge"]
    assert surge["rmse"] == pytest.approx(0.02, rel=0.3)
    assert surge["rmse_stays_still"] > 0.2
    assert plot.read_text().startswith("<?xml")
    file.write_text(file.read_text().replace("vehicle: small", "vehicle: large"))
    assert main(["predict", str(file), str(fresh), "--vehicle", str(desk.small)]) == 0
    assert "coefficients of large, record of small" in desk.capsys.readouterr().err
    assert main(["predict", str(file), str(fresh)]) == 2
    assert "name one with --vehicle" in desk.capsys.readouterr().err
    assert main(["predict", str(file), str(fresh), "--vehicle", str(desk.small), "--dof", "yaw"]) == 1
    desk.capsys.readouterr()
    assert main(["predict", str(file), str(fresh), "--vehicle", str(desk.small), "--from", "5", "--to", "2"]) == 2
    assert "--to 2: wanted more than --from 5" in desk.capsys.readouterr().err


def test_another_axis_has_its_units(desk: Desk) -> None:
    yaw = desk.of_small(as_csv(desk.folder / "a.csv", *flown(), names=("r", "N")))["motions"]["yaw"]
    assert yaw["k_q"]["unit"] == "N m s^2"


# ---- never sure without cause


@pytest.mark.parametrize(("excess_N", "reported"), [(3.0, True), (0.0, False)])
def test_a_mass_that_cannot_be_is_reported(desk: Desk, excess_N: float, reported: bool) -> None:
    velocities, (t, force) = flown()
    floats_N = load_vehicle(desk.small).net_buoyancy_N + excess_N
    heave = desk.of_small(as_csv(desk.folder / "heave.csv", velocities, (t, force + floats_N), ("w", "Z")))["motions"][
        "heave_down"
    ]
    assert any("check mass_kg, volume_m3" in one for one in heave["warnings"]) == reported


@pytest.mark.parametrize(
    "record",
    [
        {"levels": (0.05, 0.1), "noise": 0.03},
        {"levels": (0.15,), "noise": 0.02},
        {"levels": (3.0,), "end_s": 6.0},
        {"gain": 0.0},
        {"levels": (8.0,), "span_s": 1000.0},
    ],
    ids=["drowned in noise", "one slow speed", "too short", "no thrust", "thrust never changes"],
)
def test_what_cannot_be_known_is_called_so(desk: Desk, record: dict[str, Any]) -> None:
    surge = desk.surge(desk.csv(**record))
    assert not surge["identifiable"]
    assert surge["reasons"]


def test_the_wrong_sign_is_named(desk: Desk) -> None:
    surge = desk.surge(desk.csv(gain=-1.0, end_s=25.0))
    assert not surge["identifiable"]
    assert "against_thrust" in surge["reason_codes"]


def test_a_current_is_seen_or_its_harm_lies_within_the_band(desk: Desk) -> None:
    """A slow one, as it is not seen; hindrax_ident's test_honesty.py has others."""
    surge = desk.surge(desk.csv(current=0.03))
    assert not surge["identifiable"] or is_true(surge)


def test_motion_that_has_nothing_to_do_with_the_thrust(desk: Desk) -> None:
    (t, _), forces = flown(end_s=40.0)
    wander = np.cumsum(np.random.default_rng(3).standard_normal(len(t))) * 0.02
    surge = desk.surge(as_csv(desk.folder / "a.csv", (t, wander), forces))
    assert not surge["identifiable"]


def test_a_slow_record_still_shows_the_drag_over_its_speeds(desk: Desk) -> None:
    surge = desk.surge(desk.csv(levels=(0.3, 0.5), noise=0.003))
    band = surge["drag_force"]
    truth = [TRUTH["k_q"] * u * u + TRUTH["k_l"] * u for u in band["speed"]]
    pairs = zip(band["force"], band["std"], truth, strict=True)
    assert all(abs(force - true) < 4.0 * std for force, std, true in pairs)


def test_pauses_part_the_record(desk: Desk) -> None:
    (t, v), forces = flown()
    keep = (t < 30.0) | (t > 40.0)
    surge = desk.surge(as_csv(desk.folder / "a.csv", (t[keep], v[keep]), forces))
    assert surge["identifiable"]
    assert is_true(surge)


@pytest.mark.parametrize(("speed", "force"), [(1000.0, 1.0), (0.01, 1.0)])
def test_wrong_units_are_suspected(desk: Desk, speed: float, force: float) -> None:
    (t, v), (t_w, w) = flown()
    surge = desk.surge(as_csv(desk.folder / "a.csv", (t, speed * v), (t_w, force * w)))
    assert not surge["identifiable"]
    assert any(code.startswith("implausible") for code in surge["reason_codes"])


def test_the_gain_of_our_own_thrusters_may_be_doubted_too(desk: Desk) -> None:
    bag = clone_root() / "test" / "replay" / "bags" / "yaw_replug"
    found = [desk.identified(bag, *words)["motions"]["yaw"] for words in ([], ["--gain-sigma", 0.3])]
    assumed, doubted = (yaw["added_mass"] for yaw in found)
    assert doubted["value"] == assumed["value"]
    assert doubted["std_calibrated"] > 2.0 * assumed["std_calibrated"]


@pytest.mark.parametrize(("words", "share"), [([], 0.1), (["--gain-sigma", 0.2], 0.2)])
def test_the_gain_of_a_wrench_is_never_taken_as_exact(desk: Desk, words: list[str], share: float) -> None:
    document = desk.of_small(desk.csv(gain=1.15, end_s=60.0), *words)
    k_q = document["motions"]["surge"]["k_q"]
    budget = document["motions"]["surge"]["budget"]["k_q"]
    assert budget["gain of the wrench"] == pytest.approx(share * k_q["value"], rel=0.1)
    # The rest is what thrusters may lose: the record has no coasts that would tell.
    assert 0.95 < k_q["std_calibrated"] / math.hypot(k_q["std"], share * k_q["value"]) < 1.5
    assert any("--gain-sigma" in one for one in document["assumptions"])


def test_stamps_of_others_leave_the_added_mass_in_doubt(desk: Desk) -> None:
    (t, v), forces = flown()
    late = desk.surge(as_csv(desk.folder / "a.csv", (t + 0.1, v), forces))
    assert abs(late["added_mass"]["value"] - TRUTH["added_mass"]) < 3.0 * late["added_mass"]["std"]


# ---- all axes together


def pilot_csv(folder: Path) -> Path:
    """Surge and sway that are flown at once, by the same thrust."""
    (t, v), (at, force) = flown(end_s=40.0)
    rows = [(one, f"{speed:.4f},{speed:.4f},,") for one, speed in zip(t, v, strict=True)]
    rows += [(one, f",,{newton:.4f},{newton:.4f}") for one, newton in zip(at, force, strict=True)]
    file = folder / "pilot.csv"
    file.write_text("\n".join(["t,u,v,X,Y", *(f"{one:.4f},{row}" for one, row in sorted(rows))]))
    return file


@pytest.mark.parametrize(
    ("words", "fitted"), [((), True), (("--no-joint",), False), (("--joint",), True), (("--dof", "surge"), False)]
)
def test_a_record_that_moves_axes_at_once_is_fitted_with_all_of_them_unless_told_otherwise(
    desk: Desk, words: tuple[str, ...], fitted: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = []

    def refuses(*_arguments: object, **_more: object) -> None:
        asked.append(1)
        raise UsageError("no stretch is long enough")

    monkeypatch.setattr(identify, "identify_jointly", refuses)
    record = pilot_csv(desk.folder)
    if "--joint" in words:
        assert desk.refused(record, "--vehicle", desk.small, *words).endswith("no stretch is long enough")
    else:
        assumed = desk.of_small(record, *words)["assumptions"]
        together = [one for one in assumed if "all axes are fitted together too" in one]
        failed = [one for one in assumed if one == "no fit of all axes together: no stretch is long enough"]
        assert (len(together), len(failed)) == ((1, 1) if fitted else (0, 0))
    assert bool(asked) == fitted


@pytest.mark.parametrize("asked", [False, True])
def test_a_fit_of_all_axes_that_identifies_nothing_is_a_sentence_unless_it_was_asked_for(
    desk: Desk, asked: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of another vehicle's thrusters it was the first table, with a k_q of 228 +- 468."""
    number = array(np.array([0.4]))
    drag = DragBand(number, number, number, number)
    sway = JointMotion({"k_q": Number(228.0, 468.0, 468.0)}, drag, (), (Objection(Code.HARDLY_MOVED, "still"),))
    none = array(np.full((6, 6), np.nan))
    joint = JointResults({"sway": sway}, none, none, {}, {}, converged=True)
    monkeypatch.setattr(identify, "identify_jointly", lambda *_arguments, **_more: joint)
    words = ["--joint"] if asked else []
    assert main(["identify", str(pilot_csv(desk.folder)), "--vehicle", str(desk.small), *words]) == 0
    said = desk.capsys.readouterr().out
    assert ("228" in said) == asked
    assert ("All axes together, no motion is identifiable; --joint shows that fit" in said) != asked


# ---- several records


def test_several_records_are_pooled_and_their_spread_is_shown(desk: Desk) -> None:
    records = [as_csv(desk.folder / f"{seed}.csv", *flown(seed=seed)) for seed in range(2)]
    assert main(["identify", *map(str, records), "--vehicle", str(desk.small), "--json"]) == 0
    captured = desk.capsys.readouterr()
    assert "1.csv alone, 2 of 2" in captured.err
    document = json.loads(captured.out)
    pooled, runs = document["motions"]["surge"], [run["motions"]["surge"] for run in document["runs"]]
    assert is_true(pooled)
    assert len(runs) == 2
    assert pooled["samples"] > 1.8 * runs[0]["samples"]
    assert pooled["k_q"]["std"] < max(run["k_q"]["std"] for run in runs)
    assert document["spread"]["surge"]["k_q"]["runs"] == 2


def test_records_that_disagree_widen_the_band(desk: Desk) -> None:
    records = [desk.csv(), as_csv(desk.folder / "b.csv", *flown(k_q=90.0))]
    document = desk.of_small(*records)
    pooled = document["motions"]["surge"]["k_q"]
    assert document["spread"]["surge"]["k_q"]["ratio"] > 3.0
    assert abs(pooled["value"] - 78.0) < 15.0
    assert pooled["std"] > 3.0 * document["runs"][0]["motions"]["surge"]["k_q"]["std"]


# ---- wrong use


def test_a_record_that_does_not_exist(desk: Desk) -> None:
    assert "does not exist" in desk.refused(desk.folder / "none.mcap")


@pytest.mark.parametrize(
    ("words", "wanted"), [(["--from", 50], "the record lasts"), (["--from", 5, "--to", 2], "--to")]
)
def test_a_span_that_the_record_does_not_hold(desk: Desk, words: list[object], wanted: str) -> None:
    assert wanted in desk.refused(desk.csv(end_s=5.0), *words)


def test_an_aborted_run_reports_it_whoever_shows_it(desk: Desk) -> None:
    bag = desk.folder / "run" / "bag"
    shutil.copytree(clone_root() / "test" / "replay" / "bags" / "surge", bag)
    assert main(["identify", str(desk.folder / "run")]) == 0
    # The pilot tells of no end: the record was cut off in flight, as by a power cut.
    assert "aborted by record: it ends within the maneuver (surge, plateau);" in desk.capsys.readouterr().err
    (desk.folder / "run" / "coefficients.yaml").write_text("aborted: 'operator: stopped by Ctrl-C'\nmotions: {}\n")
    assert main(["identify", str(desk.folder / "run"), "--coefficients", str(desk.folder / "again.yaml")]) == 0
    printed_text = "aborted by operator: stopped by Ctrl-C; the results are of the part flown until then\n"
    assert printed_text in desk.capsys.readouterr().err
    assert read_coefficients(desk.folder / "again.yaml").conditions.aborted == "operator: stopped by Ctrl-C"
    document = desk.identified(bag)
    assert (document["aborted"], document["aborted_by"]) == ("operator: stopped by Ctrl-C", "operator")


def test_a_span_of_our_own_bag_in_which_nothing_was_flown(desk: Desk) -> None:
    assert "no motion was flown from 900 s" in desk.refused(
        clone_root() / "test" / "replay" / "bags" / "pitch_reset", "--from", 900
    )


def test_our_own_bag_without_a_maneuver_is_called_so(desk: Desk) -> None:
    flown = clone_root() / "test" / "replay" / "bags" / "surge"
    bag = recover(flown, desk.folder / "bag", keep=lambda topic, _: topic != resolved(MANEUVER)).output
    printed = desk.refused(bag)
    assert "is a bag of this stack, and no maneuver was flown in it" in printed
    assert "--odometry /hindrax/navigation/odometry" in printed


@pytest.mark.parametrize(("latency_s", "printed_text"), [(0.07, "0.07 s too late"), (-0.07, "0.07 s too early")])
def test_velocities_come_late_or_early(latency_s: float, printed_text: str) -> None:
    assert identify._delays(0.01, latency_s) == f"thrust 0.01 s; velocity stamps {printed_text}"


def test_without_a_vehicle_file_the_assumption_is_reported(desk: Desk) -> None:
    document = desk.identified(desk.csv())
    assert any("--vehicle" in one for one in document["assumptions"])
    assert main(["identify", str(desk.csv())]) == 0
    assert "COB-2023" not in desk.capsys.readouterr().out, "the paper stands beside its own vehicle only"
    assert "added_mass" not in document["motions"]["surge"]
    assert math.isclose(document["motions"]["surge"]["k_q"]["value"], TRUTH["k_q"], rel_tol=0.05)


@pytest.mark.parametrize(
    "words",
    [
        ["identify", "RECORD", "--report", "none/a.html"],
        ["identify", "RECORD", "--coefficients", "none/a.yaml"],
        ["predict", "RECORD", "RECORD", "--plot", "none/a.png"],
        ["bag", "plot", "RECORD", "/a:b", "--out", "none/a.png"],
    ],
)
def test_a_place_that_cannot_be_written_is_reported_before_the_work(desk: Desk, words: list[str]) -> None:
    place = {"RECORD": "no-record", words[-1]: str(desk.folder / words[-1])}
    assert main([place.get(word, word) for word in words]) == 2
    printed = desk.capsys.readouterr().err
    assert f"{words[-1]}: cannot be written (No such file or directory)" in printed
    assert "no-record" not in printed


def test_what_is_no_record_is_told_which_files_are(desk: Desk, tmp_path: Path) -> None:
    letter = tmp_path / "README.md"
    letter.write_text("# Read me\n", encoding="utf-8")
    assert main(["identify", str(letter)]) == 2
    told = desk.capsys.readouterr().err
    for ending in (".mcap", ".csv", ".bin", ".ulg"):
        assert ending in told


def test_a_bag_of_another_vehicle_than_the_named_one_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    bag = str(clone_root() / "test" / "replay" / "bags" / "surge")
    assert main(["identify", bag, "--vehicle", "bluerov2"]) == 0
    assert "the record is of hindrax, --vehicle names bluerov2" in " ".join(capsys.readouterr().err.split())
    assert main(["identify", bag, "--vehicle", "hindrax"]) == 0
    assert "the record is of" not in capsys.readouterr().err
