"""The tables of every command on narrow screens: what a wide screen shows is there too, and whole, with its unit."""

import re
import shlex
import subprocess
import sys
from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import yaml
from rich.console import Console

from hindrax_analysis import terminal
from hindrax_analysis.gains.hold_gains import designed
from hindrax_analysis.identification.known_weight import Weighing
from hindrax_analysis.identification.montecarlo import CoefficientError, DragError, Trial, summary
from hindrax_analysis.identification.pool_session import PoolSession, Reached, Step
from hindrax_analysis.identification.verdict import NextFlight
from hindrax_analysis.terminal import ResultTable
from hindrax_bag.read.survey import ListedBag
from hindrax_bag.run_folder import RunFolder
from hindrax_bringup.clone import clone_root
from hindrax_bringup.share_files import default_vehicle
from hindrax_cli import command_line, pool_plan
from hindrax_cli.command import MODULES
from hindrax_cli.command_line import load, main, parser_of, print_overview
from hindrax_cli.commands.data import bag
from hindrax_cli.commands.experiment import weigh
from hindrax_cli.commands.explain import benchmark, trials
from hindrax_cli.commands.machine import doctor, vehicle
from hindrax_cli.commands.operate import commission, status
from hindrax_cli.commands.operate.status import StackStatus
from hindrax_cli.commands.pool import guided_session, tune
from hindrax_cli.health_checks import Check
from hindrax_control.commissioning.findings import Finding, Findings, Mend
from hindrax_control.maneuver.plan import plans_of
from hindrax_core.text import screen_text
from hindrax_core.text.refusals import NOTHING, Reason, Refusal
from hindrax_core.text.screen_text import COMMAND, UNBOUNDED
from hindrax_core.vehicle import AXES, AxisGain, load_vehicle
from hindrax_ident.arrays import array
from hindrax_ident.assess.assessment import METHOD
from hindrax_ident.assess.objections import unnamed
from hindrax_ident.assess.results import DragBand, MotionResult, NextStep, Number, Results
from hindrax_ident.model import motion_model
from hindrax_ident.remedies import WEIGH_THRUST
from hindrax_laboratory import pendulum
from hindrax_laboratory.benchmark.blind_benchmark import Common, Row
from hindrax_operator.pool_run import FlownManeuver, finish
from hindrax_sim.flights.rehearsal import ExpectedBand, Flown, Rehearsal
from hindrax_sim.flights.step_flight import StepOutcome
from hindrax_tools.faults import device_faults, process_faults
from hindrax_tools.faults import table as fault_table
from hindrax_tools.faults.fault_outcome import EVERY_MODE, FaultOutcome
from hindrax_tools.reference.commands import words_of

BAGS = clone_root() / "test" / "replay" / "bags"
COMMANDS = {
    "allocate": "allocate --wrench 14 0 2 0 0 0.5 --disable T3",
    "estimate": "estimate --vehicle hindrax",
    "vehicle": "vehicle show hindrax",
    "papers": "papers",
    "bag": f"bag info {BAGS / 'surge_estimates'}",
    "bag list": f"bag list {BAGS}",
    "identify": f"identify {BAGS / 'surge'}",
}
"""One that prints a table and needs neither a vehicle nor minutes, by its name, or name and word."""
RECORDS = {
    "free-decay": "free-decay {}/decay.csv --mass 0.39 --volume 0.00056 --stiffness 1127.7",
    "forced": "forced {}/forced.csv --motion heave --mass 78 --length 0.875",
    "pendulum": "pendulum {}/pendulum.csv --mass 3.739 --arm 0.4 --buoyancy-kgf 2.24",
    "step": "step --mass 3.739 --added-mass 1.66 --k-l 61.89 --k-q 0.398",
    "towing": "towing {}/towing.csv",
    "bollard": "bollard {}/bollard.csv --supply 14.8 --load-cell-std 0.02",
    "predict": f"predict {{}}/coefficients.yaml {BAGS / 'surge'} --window 3",
}
"""Commands that read a record."""


def show_stacks() -> None:
    status._show([StackStatus(4348, "pool-test surge in mock", "lbv (mock)", "2", "armed", 16.0, bag="runs/a/bag")])


def show_trials() -> None:
    errors = tuple(
        CoefficientError("heave_down", "k_q", method, 1.5, 0.5, 0.5, 66.48, 0.9)
        for method in (METHOD, "rls", "plateaus")
    )
    flown = [Trial(seed, errors, (DragError("heave_down", 1.0, 0.01, 0.1),)) for seed in (1, 2)]
    trials.print_montecarlo(summary(flown))


def show_faults() -> None:
    found = [FaultOutcome("control", "died", mode, 1, 0.5, 0.0, 2.0, "too late: 1 s") for mode in EVERY_MODE]
    trials.print_faults("Time to neutral, the longest of 3 seeds", fault_table, found, [])


def show_bench() -> None:
    rows = {"name": "allocation, 8 thrusters", "ours_us": 5.7, "peer_us": 25.8, "ratio": 4.5, "peer": "quadprog"}
    trials.print_bench([rows])


def show_weighing() -> None:
    gain = AxisGain(load=15.0, sigma=0.0061192, sigma_difference=0.01294, positive=0.92169, negative=None)
    weigh.show(Weighing("surge", gain, {"alignment": 0.0006}, 0.0, 0.5), "not saved")


def show_gains() -> None:
    gains = designed(load_vehicle(default_vehicle()), [])
    outcome = StepOutcome(3.2, 0.001, settled=True), StepOutcome(14.0, 0.1, settled=False)
    tune._show(gains, {"1 m along": outcome}, ["tune", "runs/first"])


def show_findings() -> None:
    rows = (
        Finding("T3 (channel 2)", "wrong", "55 deg", "pushes the other way", 0.99, "turn it", (Mend(("name",), 1),)),
        Finding("depth", "proven", "down", "down"),
    )
    commission._show(Findings(rows, "", {}), ["  runs/a/commissioning.svg"], "runs/a/commissioning.txt")


def show_plan() -> None:
    band = ExpectedBand(0.45, 0.023, 0.21, 0.26, (unnamed("the DVL loses the bottom"),))
    flown = Flown("surge", 0.0, 115.0, 1.54, 0.66, 0.17)
    pool_plan.show(Rehearsal("hindrax", "pool", (), (flown,), {"surge": band}, "", NOTHING))


def show_scores() -> None:
    ours, theirs = Row(0.62, 0.11, 0.14, 0.95, 3.2), Row(1.0, 0.14)
    benchmark.print_rows({"ours": ours, "theirs": theirs})
    benchmark.print_common("ours", {"theirs": Common(78, ours, theirs)})


PRINTERS: dict[str, Callable[[], None]] = {
    "benchmark": show_scores,
    "status": show_stacks,
    "montecarlo": show_trials,
    "faults": show_faults,
    "bench": show_bench,
    "weigh": show_weighing,
    "pool-test": show_plan,
    "tune": show_gains,
    "commission": show_findings,
}
"""What the others print; they need minutes, a stack or a person. Results of a pool test are those of `identify`."""
WITHOUT_UNIT = {
    "messages",
    "bytes each",
    "Hz",
    "MB",
    "s",
    "windows",
    "ratio",
    "RMSE / bound",
    "RMSE / std",
    "ROS domain",
    "error (still)",
    "agrees",
    "misprint",
    "does not follow",
    "gain",
}
"""Headings of numbers that count something, are a ratio, or are a unit themselves."""
FRAME = re.compile("[\u2500-\u257f;]")


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a record for each bench experiment."""
    folder = tmp_path_factory.mktemp("records")
    clock = array(np.arange(0.0, 20.0, 0.01))
    swing = np.exp(-0.06 * clock) * np.cos(6.0 * clock)
    pulse = np.concatenate((np.arange(1100.0, 1470.0, 20.0), np.arange(1540.0, 1901.0, 20.0)))
    angle = pendulum.simulate(clock, np.array([-6.7, 0.4, 0.5]), 1.0)
    columns = {
        "decay": {"time_s": clock, "acceleration_mps2": -0.7 * swing},
        "forced": {"time_s": clock, "displacement_m": 0.02 * np.sin(2.0 * clock), "Z_N": 13.0 * np.sin(2.0 * clock)},
        "pendulum": {"time_s": clock, "theta_rad": angle},
        "towing": {
            "speed_mps": np.arange(0.1, 1.01, 0.1),
            "drag_N": 3.0 * np.arange(0.1, 1.01, 0.1) + 0.01 * pulse[:10],
        },
        "bollard": {"pulse_us": pulse, "load_N": (pulse - 1500.0) / 26.0},
    }
    for name, one in columns.items():
        rows = [",".join(one), *(",".join(map(repr, map(float, row))) for row in zip(*one.values(), strict=True))]
        (folder / f"{name}.csv").write_text("\n".join(rows), encoding="utf-8")
    numbers = {"k_q": 66.5, "k_l": 1.25, "b": 0.0, "added_mass": 12.1}
    surge = {name: {"value": value, "std": 0.1} for name, value in numbers.items()}
    (folder / "coefficients.yaml").write_text(yaml.safe_dump({"motions": {"surge": surge}}), encoding="utf-8")
    return folder


@pytest.fixture(scope="module")
def tables(records: Path) -> Mapping[str, list[ResultTable]]:
    """The tables that each command prints."""
    found: dict[str, list[ResultTable]] = defaultdict(list)

    def kept(name: str, table: ResultTable) -> list[str]:
        table.columns = [one for one in table.columns if any(one.cells) or (one.header and one.no_wrap)]
        found[name].append(table)
        return []

    with pytest.MonkeyPatch.context() as patch:
        for name in (*COMMANDS, *RECORDS, *PRINTERS):
            patch.setattr(terminal, "_print_whole_or_stacked", partial(kept, name))
            if name in PRINTERS:
                PRINTERS[name]()
            else:
                assert main({**COMMANDS, **RECORDS}[name].replace("{}", str(records)).split()) == 0, name
    return found


def show_thruster_fit() -> None:
    pulses = [1100, 1200, 1300, 1400, 1475, 1525, 1600, 1700, 1800, 1900]
    with TemporaryDirectory() as folder:
        sweep = Path(folder, "sweep.csv")
        sweep.write_text(
            "\n".join(["pulse_us,load_N,supply_V", *(f"{x},{(x - 1500) / 52 + x % 3 / 50},14.8" for x in pulses)])
        )
        words = ["--lever-ratio", "2", "--load-cell-std", "0.005", "--plot", str(Path(folder, "curve.png"))]
        assert main(["thruster", "fit", str(sweep), *words]) == 0


def words_on(
    width: int, table: ResultTable, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> set[str]:
    """Words that are printed, with the units of headings."""
    monkeypatch.setattr(terminal, "console", lambda: Console(width=width, file=sys.stdout))
    terminal._print_whole_or_stacked(table)
    printed = capsys.readouterr().out
    assert "\u2026" not in printed
    return set(FRAME.sub(" ", printed).split())


def test_every_command_that_prints_tables_is_here() -> None:
    prints = re.compile(r"\b(print_table\(|print_values\(|show\(found)")
    root = clone_root() / "src" / "hindrax_cli"
    paths = {dotted: root / f"{dotted.replace('.', '/')}.py" for dotted in MODULES.values()}
    found = {dotted for dotted, path in paths.items() if prints.search(path.read_text(encoding="utf-8"))}
    here = {MODULES[name.partition(" ")[0]] for name in (*COMMANDS, *RECORDS, *PRINTERS)}
    assert found == here - {MODULES["pool-test"]}


@pytest.mark.parametrize("name", MODULES)
def test_the_help_of_a_command_breaks_between_words(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    # argparse keeps options that exclude each other on one line.
    lines = [line for line in parser_of(load(name)).format_help().splitlines() if " | " not in line]
    assert not [line for line in lines if len(line) > 60 and " " in line.strip() and not COMMAND.search(line)]


@pytest.mark.parametrize("name", MODULES)
def test_the_help_of_a_command_keeps_its_words_whole(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "200")
    wide = parser_of(load(name)).format_help().split()
    monkeypatch.setenv("COLUMNS", "60")
    assert parser_of(load(name)).format_help().split() == wide


@pytest.mark.parametrize("name", ["bollard", "identify"])
def test_an_example_of_the_wheel_stays_on_its_line_too(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    in_a_clone = parser_of(load(name)).format_help().partition("\nexample:\n")[2]
    monkeypatch.setattr(screen_text, "FROM_WHEEL", True)
    from_the_wheel = parser_of(load(name)).format_help().partition("\nexample:\n")[2]
    assert len(in_a_clone.splitlines()[0]) > 60
    assert from_the_wheel == in_a_clone.replace("./hindrax ", "hindrax ")


@pytest.mark.parametrize("name", MODULES)
def test_an_example_can_be_pasted(name: str) -> None:
    """Into any shell: one without remarks after a command takes it, and the command takes its words."""
    parser = parser_of(load(name))
    for one in (parser, *words_of(parser)):
        example = (one.epilog or "").removeprefix("example:\n")
        lines = [line for line in example.splitlines() if not line.startswith("  # ")]
        assert lines
        assert all(line.startswith("  ") and len(line) <= 60 for line in example.splitlines() if line not in lines)
        for line in lines:
            assert subprocess.run(["bash", "-n", "-c", line], check=False).returncode == 0, line
            tool, command, *words = shlex.split(line.split(" || ")[0].strip().removeprefix("sudo "))
            if tool != "ros2":
                assert (tool, command) == ("./hindrax", name)
                parser.parse_args(words)


def test_the_overview_breaks_between_words(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    for module in (command_line, screen_text):
        monkeypatch.setattr(module, "screen_width", lambda _: 60)
    print_overview()
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > len(MODULES)
    assert not [line for line in lines if len(line) > 60]


@pytest.mark.parametrize("command", [*COMMANDS, *RECORDS, *PRINTERS])
def test_nothing_is_cut(
    command: str,
    tables: Mapping[str, list[ResultTable]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert tables[command]
    for table in tables[command]:
        wide = words_on(UNBOUNDED, table, monkeypatch, capsys)
        # A name stands without its heading where a row has lines of its own, so that has no unit.
        headings = " ".join(str(one.header) for one in table.columns if one.no_wrap and one.justify == "left")
        assert "[" not in headings
        spare = [one for one in table.columns if str(one.header) in getattr(table, "spare", ())]
        headings += " " + " ".join(f"{one.header} {' '.join(map(str, one.cells))}" for one in spare)
        for width in (80, 60):
            narrow = {word.rstrip(":") for word in words_on(width, table, monkeypatch, capsys)}
            cut = {word.rstrip(":") for word in wide} - narrow - {word.rstrip(":") for word in headings.split()}
            assert not cut, f"{width} columns"


@pytest.mark.parametrize("command", sorted({*COMMANDS, *RECORDS, *PRINTERS}))
def test_default_tables_are_tables_on_80_columns(
    command: str,
    tables: Mapping[str, list[ResultTable]],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(terminal, "console", lambda: Console(width=80, file=sys.stdout))
    for table in tables[command]:
        terminal._print_whole_or_stacked(table)
        assert "\u2547" in capsys.readouterr().out, str(table.title)


@pytest.mark.parametrize("command", [*COMMANDS, *RECORDS, *PRINTERS])
def test_every_number_has_its_unit(command: str, tables: Mapping[str, list[ResultTable]]) -> None:
    """In the heading, in a column of units, in the name of the row, or beside the number."""
    for table in tables[command]:
        headings = [str(one.header) for one in table.columns]
        named = [one for one in table.columns if one.no_wrap and one.justify == "left"]
        in_names = bool(named) and all("[" in str(cell) for cell in named[-1].cells)
        for heading, one in zip(headings, table.columns, strict=True):
            beside = all(re.search(r"[A-Za-z%]", str(cell)) for cell in one.cells if cell)
            if one.justify == "right" and heading and not (in_names or "unit" in headings or beside):
                captioned = f"{heading} [" in str(table.title)
                assert captioned or "[" in heading or heading in WITHOUT_UNIT, f"{table.title}: {heading}"


def test_a_title_that_is_longer_than_the_screen_breaks_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(terminal, "console", lambda: Console(width=40, file=sys.stdout))
    headings, rows = ["a long heading of a number"], [("surge", "1.234")]
    terminal.print_table("Drag force at shares of the tested speed", ["motion"], headings, rows)
    assert all(len(line) <= 40 for line in capsys.readouterr().out.splitlines())
    terminal.print_table("Drag force at shares of the tested speed: relative error", ["motion"], ["x" * 30], rows)
    assert capsys.readouterr().out.splitlines()[:2] == ["Drag force at shares of the tested", "  speed: relative error"]


def show_many_trials() -> None:
    motions, names = (*AXES, "heave_up"), ("k_q", "k_l", "b", "added_mass")
    errors = [CoefficientError(motion, name, METHOD, 1.5, 0.5, 0.5, 66.48, 0.9) for motion in motions for name in names]
    drag = [DragError(motion, share, 0.01, 0.1) for motion in motions for share in (0.5, 1.0)]
    trials.print_montecarlo(summary([Trial(seed, tuple(errors), tuple(drag)) for seed in (1, 2)]))


def sick_machine(problems: int) -> list[Check]:
    """As a laptop without devices finds them; paths and remedies are as long as they come."""
    fine = [Check(f"check {number}", "as it should be") for number in range(14)]
    rules = "check cable and power; `sudo docker/pi/set-up.sh` installs the udev rules that make this name"
    missing = [Check(f"/dev/hindrax/{one}", "not there", rules) for one in ("dvl", "ping", "imu", "gps", "output")]
    others = [
        Check("time", "2026-11-27 16:11 UTC, not synchronized", "start chrony or systemd-timesyncd"),
        Check("/dev/i2c-1", "not allowed, it belongs to group i2c", "sudo usermod -aG i2c $USER, log in again"),
        Check("disk", "0.3 GB free in /home/pilot/runs, wanted 0.5 GB at least", "remove runs, or name --out"),
    ]
    unasked = [Check(f"sensor{at}", "not asked: no port", f"see /dev/hindrax/{at}") for at in range(problems)]
    return [*fine, *[*others, *missing, *unasked][:problems]]


def show_sick_machine(problems: int) -> None:
    doctor.show(sick_machine(problems))


def show_many_faults() -> None:
    rows = [(row.who, row.what) for row in process_faults.ROWS] + [(row.who, row.what) for row in device_faults.ROWS]
    found = [FaultOutcome(*row, mode, 1, 0.5, 0.0, 2.0, "too late: 1 s") for row in rows for mode in EVERY_MODE]
    trials.print_faults("Time to neutral, the longest of 3 seeds", fault_table, found, [])


def show_many_rates() -> None:
    name = "record a message of 4096 bytes, chunk and flush included"
    peer = "smbus2 0.5.0, polled sample by sample, no stamp and no check"
    rows: list[dict[str, object]] = [
        {"name": f"{name} {number}", "ours_us": 5.7, "peer_us": 25.8, "ratio": 4.5, "peer": peer}
        for number in range(40)
    ]
    trials.print_bench(rows)


def show_many_bags() -> None:
    found = [ListedBag(Path(f"runs/2026-05-04_10-{at}-00/bag"), 3_000_000, True, 93.0, 9000) for at in range(10, 60)]
    bag._show_list(found, Path("runs"))


def show_long_plan(*reasons: str) -> None:
    band = ExpectedBand(0.832, 0.023, 0.21, 0.26, tuple(map(unnamed, reasons)))
    motions = ("surge", "sway", "heave_down", "heave_up", "roll", "pitch", "yaw")
    bands = dict.fromkeys(motions, band) | {"pitch": replace(band, reasons=(unnamed("the tether drags"),))}
    flown = tuple(Flown(motion, 0.0, 115.0, 1.54, 0.66, 0.17) for motion in AXES)
    plans = tuple(plans_of(load_vehicle(default_vehicle()), AXES))
    pool_plan.show(Rehearsal("hindrax", "pool", plans, flown, bands, "", NOTHING))


def show_all_motions(*reasons: str, aborted: Refusal = NOTHING, session: PoolSession | None = None) -> None:
    """Every motion, all identifiable or all refused for the same reasons."""
    names = ("surge", "sway", "heave_down", "heave_up", "roll", "pitch", "yaw")
    numbers = {
        name: Number(*((55.0, 5.84) if name == "k_q" else (-0.291, 0.0573)), truth=0.1127, unit=unit)
        for name, unit in motion_model.coefficient_units(3).items()
    }
    drag = DragBand(array([0.1, 0.832]), array([0.1, 0.819]), array([0.01, 0.08]), array([0.01, 0.08]))
    quality = {"held_out_rmse": 0.0123, "held_out_rmse_stays_still": 0.234}
    motions = {
        name: MotionResult(
            name,
            METHOD,
            numbers,
            identifiable=not reasons,
            reasons=tuple(map(unnamed, reasons)),
            drag=drag,
            quality=quality,
            next_step=NextStep(WEIGH_THRUST, 0.05),
        )
        for name in names
    }
    found: Any = SimpleNamespace(
        results=Results(motions, load_vehicle(default_vehicle())), left_out=(), predicted={}, spreads={}
    )
    if session is not None:
        guided_session.show_end(found, session, RunFolder(Path("runs/2026-05-04_10-00-00")))
        return
    flight = FlownManeuver(aborted=aborted, vehicle_s=387.0, wall_s=90.0)
    finish(found, RunFolder(Path("runs/2026-05-04_10-00-00")), flight, NextFlight())


def show_session_of_all_motions() -> None:
    motions = ("surge", "sway", "heave_down", "heave_up", "roll", "pitch", "yaw")
    reached = Reached(0.2345, 0.3456, 0.1, 0.1, 0.1, "drag of the tether with its length", "fly near its fixed end")
    names = ("legs 1", "weigh surge", "weigh sway", "weigh heave", "weigh yaw", "legs 2")
    steps = tuple(Step(name, seconds=300.0, reached=dict.fromkeys(motions, reached)) for name in names)
    show_all_motions(session=PoolSession({"mock": None, "motions": list(AXES)}, (), done=steps))


def show_doubtful_findings(verdict: str, count: int, ended: str = "") -> None:
    """A vehicle of eight thrusters and five sensors, of which the last rows are in doubt."""
    fine = [Finding(f"T{at}", "proven", f"channel {at}", "pushes as claimed, 84 % of its curve") for at in range(1, 9)]
    fine += [
        Finding("lag of the thrusters", "measured", "0.15 s", "0.15 s, roughly"),
        Finding("trim at rest", "measured", "level", "roll +0.8, pitch +1.1 deg"),
        Finding("dvl75 mount", "proven", "[0.0, 0.0, 0.0]", "its velocities follow the motion (98%)"),
        Finding("ping1d mount", "proven", "[0.0, 0.0, 0.0]", "has an echo that follows the depth"),
        Finding("ms5837 direction", "proven", "deeper is more", "deeper is more"),
        Finding("icm20948 magnetometer", "proven", "turns with the gyroscope", "explains 99% of the turning"),
    ]
    mends = [Mend(("thrusters", f"T{at}", "reversed"), True) for at in range(8)] if verdict == "wrong" else []
    doubt = [
        replace(row, verdict=verdict, found="the vehicle was not dived", remedy="look at it, and mend the file")
        for row in fine[-count:]
    ]
    kept = [f"  {one.line}" for one in mends[:count]]
    files = "  runs/2026-05-04_10-00-00/commissioning.svg", "runs/2026-05-04_10-00-00/commissioning.txt"
    commission._show(Findings((*fine[:-count], *doubt), ended), [*kept, files[0]], files[1])


VEHICLES = ("hindrax", "bluerov2", "bluerov2-heavy", "lbv")
OF_A_VEHICLE = (
    "vehicle show {}",
    "vehicle check {}",
    "estimate --vehicle {}",
    "allocate --vehicle {} --wrench 9 0 2 0 0 0",
)
FULL: dict[str, Callable[[], object]] = {
    "montecarlo": show_many_trials,
    **{f"doctor, {count} problems": partial(show_sick_machine, count) for count in (0, 3, 9, 20)},
    "pool-test": show_all_motions,
    "pool-test, refused": partial(
        show_all_motions, "speeds of 0.1 to 0.3 m/s do not separate k_q from k_l; use the drag with its interval"
    ),
    "pool-test, aborted": partial(
        show_all_motions,
        "it hardly moved",
        aborted=Refusal(Reason.POOL, "too near to a wall, 0.30 m; wanted 0.50 m at least"),
    ),
    "pool-test --session": show_session_of_all_motions,
    "pool-test --plan": show_long_plan,
    "pool-test --plan, refused": partial(show_long_plan, "the DVL loses the bottom", "it hardly moved: speed 0.01 m/s"),
    "faults, all": show_many_faults,
    "vehicle check, incomplete": lambda: vehicle._show_checks(
        replace(load_vehicle(default_vehicle()), sensors={}, hydrodynamics=None), Path("mine.yaml")
    ),
    "commission, open": partial(show_doubtful_findings, "open", 2),
    "commission, ended": partial(
        show_doubtful_findings,
        "open",
        2,
        "commission: tilted by 20.2 deg from rest, wanted at most 20.0 deg; let it come to rest, check its trim and "
        "the thrusters of the file, and commission again",
    ),
    "commission, wrong": partial(show_doubtful_findings, "wrong", 3),
    "commission, nothing as claimed": partial(show_doubtful_findings, "wrong", 14),
    "thruster fit": show_thruster_fit,
    "bench, all": show_many_rates,
    "bag list, many": show_many_bags,
    **{name: printer for name, printer in PRINTERS.items() if name not in ("montecarlo", "pool-test")},
    **{
        words: partial(main, words.split())
        for words in ("papers", *(line.format(vehicle) for line in OF_A_VEHICLE for vehicle in VEHICLES))
    },
    **{name: partial(main, COMMANDS[name].split()) for name in ("bag", "bag list")},
}
"""What prints the default tables of a command, of as many motions, checks and topics as there are."""


@pytest.mark.parametrize("command", FULL)
def test_the_default_tables_of_a_command_are_one_screen(
    command: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, value in {"COLUMNS": "80", "LINES": "24", "TERM": "dumb"}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(screen_text, "screen_width", lambda _: 80)
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    FULL[command]()
    lines = "".join(capsys.readouterr()).splitlines()
    assert lines
    assert max(len(line) for line in lines if not line.endswith(".yaml") and not COMMAND.search(line)) <= 80
    assert len(lines) <= 23, "the prompt is the last"
    assert not [line for line in lines if re.search(r"\[[^]]+\]: ", line)], "too narrow for a table"


def test_a_vehicle_that_is_proven_is_one_screen(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(terminal, "console", lambda: Console(width=80, file=sys.stdout))
    thruster = Finding("lag of the thrusters", "proven", "channel 2, 0.15 s", "pushes as claimed, 107 % of its curve")
    commission._show(Findings((thruster,) * 16, "", {}), ["  runs/a/commissioning.svg"], "runs/a/commissioning.txt")
    assert len(capsys.readouterr().out.splitlines()) <= 23
    commission._show(Findings((thruster, replace(thruster, verdict="wrong")), "", {}), [], "")
    assert "channel 2" in capsys.readouterr().out


@pytest.mark.parametrize("width", [200, 80, 60, 40])
def test_the_doctor_cuts_nothing(
    width: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(doctor, "console", lambda: Console(width=width, file=sys.stdout))
    port, sentence = "mock:/tmp/hindrax-v7u9iiwn/of/some/length/i2c", "check cable and power; " * 4
    doctor.show(
        [Check("ros", "ROS 2 jazzy"), Check(port, "socket"), Check("dvl75", f"none at {port}", sentence.strip())]
    )
    printed = capsys.readouterr().out
    assert "\u2026" not in printed
    bare = "".join(printed.split())
    for words in (port, f"noneat{port}", "".join(f"-> {sentence}".split())):
        assert words in bare
    assert all(len(line) <= width for line in printed.splitlines()[:-1])
