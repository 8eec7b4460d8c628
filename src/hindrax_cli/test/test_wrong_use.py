"""Wrong use costs one sentence that names the word, with the one that was perhaps meant, and exit code 2."""

import contextlib
import errno
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from hindrax_bringup.node_options import ParameterOverrides
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack import MockOptions
from hindrax_bringup.stack_process import UpOptions
from hindrax_bringup.stack_runner import run_up
from hindrax_bringup.testing.vehicle_files import hindrax_file
from hindrax_cli import command_line
from hindrax_cli.command import MODULES
from hindrax_cli.commands.data.bag import WORDS as BAG
from hindrax_cli.commands.operate import manual_control
from hindrax_cli.commands.pool import pool_flight
from hindrax_core.errors import HindraxError, UsageError
from hindrax_core.vehicle import load_vehicle
from hindrax_ros.free_domain import only_stack


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    try:
        code: object = command_line.main(words)
    except SystemExit as end:
        code = end.code
    captured = capsys.readouterr()
    assert code == 2
    assert captured.out == ""
    assert len(captured.err.splitlines()) == 1
    return captured.err


BRIGHTNESS = "wanted one or 2 numbers from 0 to 1, or `off`"
PLACE = "wanted nothing, or X Y [DEG]: meters from the south and the west wall"
THRUSTER = ("3", "fit", "disable", "3 T4 --force 1", "fly --force 1")
MOCKS = ("pool-test --mock", "up --mock", "mock")
NEITHER = (
    (["--rate", "nan"], "--rate: found nan, wanted 0 (no bound) or more"),
    (["--rate", "-1"], "--rate: found -1, wanted"),
    (["--seed", "-1"], "--seed: found -1, wanted 0 to 4294967295"),
    (["--seed", str(1 << 32)], "--seed: found 4294967296"),
)


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["pooltest"], "no command 'pooltest' (did you mean pool-test?); ./hindrax --help lists all"),
        (["pool_test"], "did you mean pool-test?"),
        (["frobnicate"], "no command 'frobnicate'; ./hindrax --help lists all"),
        (["pool-test", "--mok"], "no option '--mok' (did you mean --mock?); ./hindrax pool-test --help shows how"),
        (["pool-test", "--dof", "surg"], "invalid choice: 'surg' (did you mean surge?), choose from surge, sway"),
        (["pool-test", "--mock", "--excitation", "sinus"], "invalid choice: 'sinus', choose from plateaus"),
        (["pool-test", "--seed", "x"], "--seed: found 'x', wanted a whole number; "),
        (["montecarlo", "--runs", "1.5"], "--runs: found '1.5', wanted a whole number; "),
        (["montecarlo", "--runs", "0"], "--runs: found 0"),
        (["montecarlo", "--vehicle", "nowhere.yaml"], "nowhere.yaml: cannot be read"),
        (["faults", "--seeds", "0"], "found 0"),
        (["faults", "--workers", "-1"], "found -1"),
        (["web", "--port", "70000"], "--port: found 70000, wanted 0 to 65535"),
        (["ping", "show", "--device-id", "255"], "found 255, wanted 0 to 254"),
        (["dvl", "setup", "--speed-of-sound", "900"], "wanted 1100 to 1950"),
        (["dvl", "setup", "--velocity-adjustment", "2"], "wanted 0.8 to 1.25"),
        (["dvl", "setup", "--baud-rate", "300"], "wanted 9600 to 921600"),
        (["dvl", "setup", "--declination", "nan"], "wanted -360 to 360"),
        (["dvl", "setup", "--orientation", "0", "0", "400"], "wanted -360 to 360"),
        (["identify", "bag", "--to", "there"], "--to: found 'there', wanted a number; "),
        (["weigh", "surge", "--load", "15,0"], "--load: found '15,0', wanted a number with a decimal point; "),
        (["weigh", "surge", "--load", "inf"], "--load: found inf, wanted more than 0, and finite; "),
        (["pool-test", "--mock", "--minutes", "0"], "--minutes: found 0, wanted more than 0; "),
        (["pool-test", "--mock", "--until", "0"], "--until: found 0, wanted more than 0, at most 1 or 100%; "),
        (["pool-test", "--rate", "0"], "--fault, --world, --rate and --simulator are for --mock only"),
        (["pool-test", "--simulator", "gz"], "--fault, --world, --rate and --simulator are for --mock only"),
        (["pool-test", "--mock", "--simulator", "gazebo"], "wanted one of mujoco, gz, stonefish"),
        (["pool-test", "--mock", "--simulator", "gz", "--world", "pool"], "the simulator has its own water"),
        (["up", "--simulator", "gz"], "--seed and --simulator are for --mock only"),
        (["up", "--rate", "0"], "--fault, --world, --rate, --seed and --simulator are for --mock only"),
        (["pool-test", "--plan", "--rate", "0"], "--plan: found --rate, wanted no options of the stack"),
        (["pool-test", "--mock", "--world", ""], "found nothing, wanted a value; is a variable"),
        (["pool-test", "--mock", "--out", ""], "found nothing, wanted a value; is a variable"),
        (["montecarlo", "--workers", "0"], "--workers: found 0, wanted 1 or more"),
        (["pool-test", "--until", "5"], "--until: found 5, wanted more than 0, at most 1 or 100%; "),
        (["pool-test", "--mock", "--out", "/proc/nowhere"], "/proc/nowhere: cannot be written"),
        (["reference", "--example-data", "--out", "/proc/nowhere"], "--out /proc/nowhere: cannot be written"),
        (["bag", "inof"], "invalid choice: 'inof' (did you mean info?)"),
        (
            ["pool-test", "--mock", "--world", "pol"],
            "--world pol: found 'pol' (did you mean pool?); the form is ideal, pool",
        ),
        (
            ["weigh", "surge", "--mock", "--load", "15", "--world", "pol"],
            "--world pol: found 'pol' (did you mean pool?)",
        ),
        (["up", "--mock", "--world", "tehter=1"], "found 'tehter' (did you mean tether?)"),
        (["pool-test", "--mock", "--fault", "garbege:dvl75"], "found 'garbege' (did you mean garbage?)"),
        (["up", "--mock", "--fault", "garbage:dvl"], "garbage on 'dvl' (did you mean dvl75?), wanted one of"),
        (["commission", "--mock", "--world", "poo"], "hindrax commission: --world poo: found"),
        (["commission", "--mock", "--fault", "garbge"], "hindrax commission: --fault garbge: found"),
        (["commission", "--simulator", "gz"], "--fault, --world, --simulator, --rate and --seed are for --mock only"),
        (["doctor", "--mock", "--fault", "garbge"], "hindrax doctor: --fault garbge: found"),
        (["pool-test", "--mock", "--simulator", "mujco"], "found 'mujco' (did you mean mujoco?)"),
        (["pool-test", "--mock", "--start", "a", "b"], "--start: found 'a b', wanted nothing, or X Y [DEG]"),
        (["pool-test", "--mock", "--start", "5", "60"], "--start y: found 60 m, wanted 0."),
        (
            ["pool-test", "--mock", "--vehicle", "hindrx"],
            "vehicle hindrx (did you mean hindrax?): found no",
        ),
        (["allocate", "--wrench", *"50000", "nan"], "--wrench: found nan, wanted a finite number; "),
        (["bag", "info"], "hindrax bag info: the following arguments are required: BAG"),
        (["monitor"], "found no terminal to draw on, wanted one; over ssh use `ssh -t`"),
        (["hold", "depht"], "invalid choice: 'depht'"),
        (["hold", "all"], "hold all: "),
        (["hold", "all", "3"], "hold all: "),
        (["hold", "depth", "deep"], "hold depth: "),
        (["hold", "depth", "nan"], "hold depth: "),
        (["hold", "roll", "inf"], "hold roll: "),
        (["hold", "station", "3"], "hold station: "),
        *((["lights", *words.split()], BRIGHTNESS) for words in ("2", "-0.1", "nan", "bright", "1 1 1")),
        *((["recentre", *words.split()], PLACE) for words in ("5", "5 nan", "5 inf 0", "here there", "1 2 3 4")),
        *((["thruster", *words.split()], "hindrax thruster: thruster ") for words in THRUSTER),
        (["joystick", "--set", "dead_man"], "--set dead_man: wanted NAME:=VALUE"),
        (["joystick", "--set", "nobody:=4"], "--set.nobody: unknown key, wanted one of dead_man, "),
        (["joystick", "--set", "dead_man:=banana"], "--set.dead_man: found 'banana', wanted a whole number"),
        (["joystick", "--set", "dead_man:=99"], "--set.dead_man: found 99, wanted 0 to 63"),
        (["wrench", *"10", "nan", *"000"], "Z: found nan, wanted a finite number"),
        (["wrench", "1", "0"], "arguments are required"),
        *(
            (["up", *words.split()], "for --mock only")
            for words in ("--rate 2", "--seed 2", "--fault absent:dvl75@1+2")
        ),
        *(([*command.split(), *words], reason) for command in MOCKS for words, reason in NEITHER),
        (["pool-test", "--plan", "--mock", "--set", "pilot.plan.levels:=2"], "--plan: found --set, wanted no options"),
        (["pool-test", "--plan", "--world", "sea"], "sea"),
        (["weigh", "surge"], "hindrax weigh: surge: wanted --load N"),
        (["identify", "a.csv", "--from", "nan"], "--from: found nan, wanted a finite number"),
        (
            ["bag", "export", "a", "--topics", "/a", "--out", "o", "--to", "NaN"],
            "--to: found NaN, wanted a finite number",
        ),
        (["step", "--thrust", "5", "nan"], "--thrust: found nan, wanted a finite number"),
        (["report", "/no-run"], "/no-run: does not exist, wanted the folder of a run"),
        (["weigh", "yaw", "--load", "10"], "--lever M"),
        (["weigh", "surge", "--bag", "there-is-none", "--hold", "1:2"], "there-is-none"),
        (["weigh", "roll", "--load", "10"], "invalid choice"),
        (["weigh", "surge", "--load", "40"], "surge: found a load of 40 N, wanted less than the 35.6 N that its"),
        (["weigh", "heave", "--load", "500", "--mock"], "heave: found a load of 500 N, wanted less than the 62.1 N"),
        (["weigh", "yaw", "--load", "300", "--mock"], "yaw: found a load of 45 N m, wanted less than the "),
        (["weigh", "yaw", "--mock", "--lever", "0.3"], "weigh yaw: found --lever 0.3, wanted 0.15 in mock; leave it"),
        (["weigh", "yaw", "--load", "90", "--lever", "0.5"], "found a load of 45 N m, wanted less than the "),
        (["allocate", "--wrench", *"000000", "--vehicle", "/no.yaml"], "/no.yaml: cannot be read (No such file or"),
        (["allocate", "--wrench", *"000000", "--disable", "T9"], "found 'T9', wanted some of T1"),
        (["allocate", "--wrench", *"100000", "--supply", "-3"], "--supply: found -3, wanted more than 0"),
        (["thruster", "fit", "/no.csv", "--lever-ratio", "2"], "/no.csv: cannot be read (No such file or directory)"),
    ],
)
def test_one_sentence(capsys: pytest.CaptureFixture[str], words: list[str], sentence: str) -> None:
    assert sentence in refused(capsys, *words)


REFUSAL = "ROS domain 7: found the nodes of a stack"


def test_a_stack_that_is_refused_leaves_no_folder_behind(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def refuse(_domain: int, _namespace: str, _environment: dict[str, str]) -> None:
        raise HindraxError(REFUSAL)

    monkeypatch.setattr("hindrax_bringup.stack.require_no_stack", refuse)
    monkeypatch.setenv("ROS_DOMAIN_ID", "7")
    options = UpOptions(default_vehicle(), MockOptions(), out=str(tmp_path / "run"))
    with pytest.raises(HindraxError, match=REFUSAL):
        run_up(options, lambda: True)
    assert not (tmp_path / "run").exists()


def test_a_second_stack_of_a_real_vehicle_in_a_graph_is_refused(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, ros_domain: int
) -> None:
    """Two autopilots at two addresses collide at no port: the operator of the one disarmed the other."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
    options = UpOptions(default_vehicle(), out=str(tmp_path / "run"))
    with only_stack(ros_domain, "/hindrax"):
        wanted = rf"ROS domain {ros_domain}: found another stack in /hindrax on this machine, wanted none; end that one"
        with pytest.raises(HindraxError, match=wanted):
            run_up(options, lambda: True)
        run_up(replace(options, tuning=ParameterOverrides(namespace="/other")), lambda: True)
    run_up(options, lambda: True)


def test_a_pool_test_whose_stack_is_refused_leaves_no_folder_behind(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "refusing.py").write_text(f"import sys; sys.exit('hindrax up: {REFUSAL}')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    monkeypatch.setattr("hindrax_bringup.stack_process.RUNNER", "refusing")
    assert command_line.main(["pool-test", "--mock", "--out", str(tmp_path / "run")]) == 1
    assert capsys.readouterr().err.splitlines()[-1] == f"hindrax pool-test: {REFUSAL}"
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("command", ["up", "pool-test"])
@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["--params", "nofile"], "parameter file nofile: cannot be read"),
        (["--set", "pilot"], "--set 'pilot': wanted node.name:=value"),
        (["--set", "pilo.plan.levels:=2"], "the nearest is 'pilot'"),
    ],
)
def test_parameters_that_cannot_be_read_leave_no_folder_behind(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, command: str, words: list[str], sentence: str
) -> None:
    out = tmp_path / "run"
    assert command_line.main([command, "--mock", "--out", str(out), *words]) == 2
    assert sentence in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize("command", ["up", "pool-test", "commission"])
def test_a_mock_without_a_truth_is_refused_before_anything_starts(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, command: str
) -> None:
    """Not by the end of the mock's log, with a folder of a run that never was."""
    content = yaml.safe_load(default_vehicle().read_text(encoding="utf-8"))
    del content["hydrodynamics"]
    file, out = tmp_path / "bare.yaml", tmp_path / "run"
    file.write_text(yaml.safe_dump(content))
    printed = refused(capsys, command, "--mock", "--vehicle", str(file), "--out", str(out))
    assert printed.startswith(
        f"hindrax {command}: hindrax.hydrodynamics: missing, wanted the mock's truth; `./hindrax "
    )
    assert not out.exists()


def test_a_motion_that_the_vehicle_cannot_serve_is_refused_before_anything_starts(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    six, out = hindrax_file(tmp_path, (r".*name: T[78].*\n", "")), tmp_path / "run"
    words = ["pool-test", "--mock", "--vehicle", str(six), "--out", str(out), "--dof"]
    printed = refused(capsys, *words, "surge", "pitch")
    assert "pitch: no thruster serves it independently of " in printed
    assert "wanted some of surge, sway, heave, roll, yaw" in printed
    assert not out.exists()


@pytest.mark.parametrize("words", [*([name] for name in MODULES if name != "test"), *(["bag", word] for word in BAG)])
def test_every_command_has_help_with_an_example(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        command_line.main([*words, "--help"])
    assert ended.value.code == 0
    assert f"./hindrax {' '.join(words)}" in capsys.readouterr().out


def test_no_word_at_all_shows_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert command_line.main([]) == 2
    printed = capsys.readouterr().out
    assert all(f"  {name} " in printed for name in MODULES)


@pytest.mark.parametrize("buffered", [{}, {"PYTHONUNBUFFERED": "1"}])
def test_a_reader_that_has_seen_enough_costs_no_traceback(buffered: dict[str, str]) -> None:
    tool = [sys.executable, "-m", "hindrax_cli", "--help"]
    here, there = os.pipe()
    os.close(here)
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    done = subprocess.run(
        tool, stdout=there, stderr=subprocess.PIPE, env=environment | buffered, timeout=60, check=False
    )
    os.close(there)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.parametrize(("closed", "words", "code"), [(">&-", "--help", 0), ("<&- >&- 2>&-", "frob", 2)])
def test_a_caller_that_has_closed_a_standard_stream_gets_the_exit_code(closed: str, words: str, code: int) -> None:
    tool = f'exec "{sys.executable}" -m hindrax_cli {words} {closed}'
    done = subprocess.run(["bash", "-c", tool], stderr=subprocess.PIPE, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (code, "")


def test_an_output_of_another_encoding_takes_any_letter() -> None:
    tool = [sys.executable, "-m", "hindrax_cli", "vehicle", "show", "hindrax"]
    others = {**os.environ, "PYTHONIOENCODING": "cp1252"}
    done = subprocess.run(tool, capture_output=True, env=others, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"largest alone: surge" in done.stdout


def test_from_a_folder_that_is_gone_a_command_is_refused_and_a_stop_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    said = refused(capsys, "allocate", "--wrench", "10", "0", "0", "0", "0", "0")
    assert said == "hindrax allocate: the folder of this shell was removed; cd into another one\n"
    assert "--frob" in refused(capsys, "stop", "--frob")
    assert Path.cwd() == Path("/")


def test_an_answer_that_finds_no_room_costs_no_traceback() -> None:
    tool = [sys.executable, "-m", "hindrax_cli", "--help"]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(tool, stdout=full, stderr=subprocess.PIPE, text=True, timeout=60, check=False)
        printed_text = "hindrax: output: cannot be written (No space left on device); make room and run again\n"
        assert (done.returncode, done.stderr) == (1, printed_text)
        assert subprocess.run(tool, stdout=full, stderr=full, timeout=60, check=False).returncode == 1


def test_a_full_disk_wherever_a_command_writes_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def full(_name: str) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", "/run/user/1000/hindrax")

    monkeypatch.setattr(command_line, "load", full)
    monkeypatch.setattr(command_line, "mute", lambda _stream: None)
    assert command_line.main(["web"]) == 1
    printed_text = (
        "hindrax: /run/user/1000/hindrax: cannot be written (No space left on device); make room and run again\n"
    )
    assert capfd.readouterr().err == printed_text


def test_control_c_while_a_command_is_loaded_is_one_sentence(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(_name: str) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(command_line, "load", interrupted)
    assert command_line.main(["papers"]) == 130
    assert capsys.readouterr().err == "hindrax: stopped by Ctrl-C\n"


@pytest.fixture
def at_a_desk(tmp_path: Path) -> Path:
    """A vehicle file with one port that exists (a bus) and four that do not."""
    vehicle = yaml.safe_load(Path(default_vehicle()).read_text(encoding="utf-8"))
    (tmp_path / "i2c").touch()
    for name, mount in vehicle["sensors"].items():
        mount["port"] = str(tmp_path / name)
    vehicle["output"]["port"] = str(tmp_path / "i2c")
    file = tmp_path / "vehicle.yaml"
    file.write_text(yaml.safe_dump(vehicle), encoding="utf-8")
    return file


def test_a_pool_test_without_its_ports_ends_at_once_and_names_the_mock(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, at_a_desk: Path
) -> None:
    monkeypatch.setattr(pool_flight, "run_pool_test", lambda options: pytest.fail(f"flown: {options}"))
    assert command_line.main(["pool-test", "--vehicle", str(at_a_desk)]) == 1
    printed = capsys.readouterr().err
    assert len(printed.splitlines()) == 1
    sensors = load_vehicle(at_a_desk).sensors
    assert all(mount.port in printed for mount in sensors.values())
    assert str(at_a_desk.parent / "i2c") not in printed
    assert f"wanted all {len(sensors) + 1} ports" in printed
    assert printed.strip().endswith("or fly without one: --mock")


def test_ports_that_are_there_but_silent_get_their_time(monkeypatch: pytest.MonkeyPatch, at_a_desk: Path) -> None:
    flown: list[object] = []

    def run_pool_test(options: object) -> int:
        flown.append(options)
        return 0

    monkeypatch.setattr(pool_flight, "run_pool_test", run_pool_test)
    for mount in load_vehicle(at_a_desk).sensors.values():
        Path(mount.port).touch()
    assert command_line.main(["pool-test", "--vehicle", str(at_a_desk)]) == 0
    assert len(flown) == 1


def test_arm_warns_only_of_thrusters_that_can_be_armed(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    class NoStack:
        def wait_for_thrusters(self) -> None:
            raise HindraxError("waited 5 s for the thrusters node")

        def arm(self, **_: object) -> None:
            self.wait_for_thrusters()

    monkeypatch.setattr(manual_control, "operator_of", lambda _: contextlib.nullcontext(NoStack()))
    assert command_line.main(["arm"]) == 1
    assert capsys.readouterr().out == ""


def test_an_error_names_its_command_once(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    sweep = tmp_path / "sweep.csv"
    sweep.write_text("pulse_us,load_N\n" + "\n".join(f"{pulse},5" for pulse in range(1100, 1901, 20)))
    assert command_line.main(["bollard", str(sweep), "--load-cell-std", "0.02"]) == HindraxError.exit_code
    assert capsys.readouterr().err.startswith("hindrax bollard: thrust is 5 N at 1100 us")


@pytest.mark.parametrize(
    "words", [["pool-test", "--mock"], ["up", "--mock"], ["thruster", "T1", "--force", "2", "--mock"]]
)
def test_a_channel_that_drives_two_is_reported_before_anything_starts(
    words: list[str], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    file = hindrax_file(tmp_path, ("{name: T8, channel: 7,", "{name: T8, channel: 6,"))
    assert command_line.main([*words, "--vehicle", str(file)]) == UsageError.exit_code
    assert "output channel 6 drives T7 and T8" in capsys.readouterr().err
