"""The set-up: what it does when, what it says of what is missing, and how it gets over being interrupted."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from importlib import metadata
from pathlib import Path

import pytest
from stand_in_clone import LINKS, ROOT, STAND_IN, Clone, copy_clone

ALL_STEPS = ["venv", "pip", "uv-venv", "install", "colcon", "try"]


def test_the_first_run_makes_everything_and_the_second_nothing(clone: Clone) -> None:
    first = clone.run("pool-test", "--mock", "two words")
    assert first.stdout == "the tool got: pool-test --mock two words; ROS is jazzy, discovery LOCALHOST\n"
    assert first.returncode == 0
    assert clone.steps() == ALL_STEPS
    second = clone.run("pool-test")
    assert second.stdout.startswith("the tool got: pool-test;")
    assert second.stderr == ""
    assert clone.steps() == []


def test_in_the_environment_the_tool_starts_whatever_python_path_the_shell_has(clone: Clone) -> None:
    """The script of setuptools looks for its package there, and ends in a traceback of its own."""
    clone.run("setup")
    words = ". .hindrax/environment.sh; PYTHONPATH=/of/another/python hindrax status --json"
    done = subprocess.run(
        ["bash", "-c", words], cwd=clone.root, env=clone.environment, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith("the tool got: status --json; ROS is jazzy")


def test_progress_goes_to_stderr_with_the_seconds(clone: Clone) -> None:
    outcome = clone.run("setup")
    assert outcome.stdout == ""
    assert re.match(r"\[ +\d+ s\] setting hindrax up", outcome.stderr)
    assert outcome.stderr.endswith("hindrax is set up\n")


def test_while_packages_are_built_it_is_told_how_many(tmp_path: Path) -> None:
    """Those that an earlier attempt has built, and what builds none, are not counted."""
    lines = ["Finished <<< hindrax_core [1s]", "again", "Starting >>> hindrax_ros", "Finished <<< hindrax_ros [2s]"]
    (tmp_path / "log").write_text("\n".join(lines) + "\n")
    for package in ("src/one", "src/two", "setup/tf2_msgs"):
        (tmp_path / package).mkdir(parents=True)
        (tmp_path / package / "package.xml").touch()
    script = (ROOT / "setup" / "machine.sh").read_text(encoding="utf-8")
    function = script[script.index("built_since() {") :].partition("\n}\n")[0] + "\n}\n"
    told = (
        f'set -euo pipefail; log=log root=.; {function} echo "still building$(built_since 2)"; echo "x$(built_since 4)"'
    )
    done = subprocess.run(["bash", "-c", told], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert done.stdout == "still building: 1 of 3 packages\nx\n"


@pytest.mark.parametrize("step", ALL_STEPS[:-1])
def test_a_kill_at_any_step_is_repaired_by_the_next_run(clone: Clone, step: str) -> None:
    assert clone.run("setup", DIE_IN=step).returncode == -signal.SIGKILL
    clone.steps()
    again = clone.run("test")
    assert again.stdout.startswith("the tool got: test;")
    assert clone.steps() == ALL_STEPS[{"pip": 0, "install": 2}.get(step, ALL_STEPS.index(step)) :]
    assert not list(clone.root.rglob("half*"))
    assert clone.run("test").stderr == ""


def test_control_c_ends_it_although_the_builder_takes_it_for_itself(clone: Clone) -> None:
    process = clone.start("test", BUILD_S="300")
    while not clone.calls.exists() or "colcon" not in clone.calls.read_text(encoding="utf-8"):
        assert process.poll() is None
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    process.communicate(timeout=60)
    assert process.returncode == 130
    assert clone.steps().count("colcon") == 1
    assert clone.run("test").returncode == 0


def test_control_c_before_python_starts_is_one_sentence(clone: Clone) -> None:
    assert clone.run("setup").returncode == 0
    begun = clone.tools / "begun"
    clone.tool("sha256sum", f"#!/bin/sh\ntouch {begun}\nexec sleep 300\n")
    process = clone.start("test")
    while not begun.exists():
        assert process.poll() is None
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    assert process.communicate(timeout=60) == ("", "hindrax: stopped by Ctrl-C\n")
    assert process.returncode == 130


def test_an_environment_without_its_stamp_is_made_anew(clone: Clone) -> None:
    clone.run("setup")
    clone.steps()
    env = clone.root / ".hindrax/env"
    (env / "complete").unlink()
    (env / "rclpy").unlink()
    (env / "half").touch()
    (clone.root / ".hindrax/ready").unlink()
    assert clone.run("test").returncode == 0
    assert clone.steps() == ["uv-venv", "install", "try"]
    assert not (env / "half").exists()


def test_setup_repairs_an_environment_that_lost_files(clone: Clone) -> None:
    clone.run("setup")
    (clone.root / ".hindrax/env/rclpy").unlink()
    clone.steps()
    outcome = clone.run("setup")
    assert "does not work; making it anew" in outcome.stderr
    assert clone.steps() == ["try", "uv-venv", "install", "colcon", "try"]
    assert outcome.returncode == 0


@pytest.mark.parametrize("part", [".hindrax/env", ".hindrax/environment.sh", "ros_ws/install", "ros_ws/build"])
def test_what_was_deleted_comes_back(clone: Clone, part: str) -> None:
    clone.run("setup")
    subprocess.run(["rm", "-r", clone.root / part], check=True)
    assert clone.run("setup").returncode == 0
    assert clone.run("test").returncode == 0


@pytest.mark.parametrize(
    ("name", "steps"),
    [
        ("src/hindrax_msgs/msg/Heartbeat.msg", ["colcon", "try"]),
        ("src/hindrax_msgs/msg/New.msg", ["colcon", "try"]),
        ("src/hindrax_bringup/setup.cfg", ["colcon", "try"]),
        ("src/hindrax_bringup/vehicles/second.yaml", ["colcon", "try"]),
        ("src/hindrax_cli/hindrax_cli/main.py", []),
        ("setup/wheels.lock", ["uv-venv", "install", "colcon", "try"]),
        ("setup/bootstrap.lock", ["venv", "pip", "try"]),
        ("setup/wheels.cmake", ["colcon", "try"]),
        ("setup/machine.sh", ["try"]),
        ("src/hindrax_bringup/launch/__pycache__/mock.launch.cpython-311.pyc", []),
        ("README.md", []),
    ],
)
def test_only_what_changed_is_made_again(clone: Clone, name: str, steps: list[str]) -> None:
    clone.run("setup")
    clone.steps()
    clone.edit(name)
    assert clone.run("test").returncode == 0
    assert clone.steps() == steps


def details(clone: Clone) -> list[str]:
    """What the builder said of the messages, since the last question."""
    file = clone.calls.with_name(f"{clone.calls.name}.details")
    lines = file.read_text(encoding="utf-8").splitlines() if file.exists() else []
    file.unlink(missing_ok=True)
    return [line for line in lines if line == "kept"]


@pytest.mark.parametrize("shared", [False, True])
def test_compiled_messages_are_kept_by_their_definitions(clone: Clone, shared: bool, tmp_path: Path) -> None:
    where = {"HINDRAX_CACHE": str(tmp_path / "several clones")} if shared else {}
    store = (tmp_path / "several clones" if shared else clone.root / ".hindrax/cache") / "messages"
    prefix = clone.root / "ros_ws/install/hindrax_msgs/prefix.sh"
    definition = clone.root / "src/hindrax_msgs/msg/Heartbeat.msg"
    before = definition.read_text(encoding="utf-8")
    clone.run("setup", **where)
    assert (details(clone), len(list(store.glob("*.tar")))) == ([], 1)
    made = prefix.read_text()
    assert str(clone.root) in made

    def again() -> list[str]:
        subprocess.run(["rm", "-r", clone.root / "ros_ws/build", clone.root / "ros_ws/install"], check=True)
        assert clone.run("setup", **where).returncode == 0
        return details(clone)

    assert again() == ["kept"]
    assert prefix.read_text() == made
    clone.edit("src/hindrax_bringup/setup.cfg")
    clone.run("setup", **where)
    assert details(clone) == ["kept"]
    clone.edit("src/hindrax_msgs/msg/Heartbeat.msg")
    clone.run("setup", **where)
    assert (details(clone), len(list(store.iterdir()))) == ([], 2)
    definition.write_text(before, encoding="utf-8")
    clone.run("setup", **where)
    assert details(clone) == ["kept"]
    for file in store.glob("*.tar"):
        file.write_bytes(b"cut off")
    assert again() == []
    assert prefix.read_text() == made


def test_another_clone_takes_the_messages_of_the_first_with_its_own_paths(clone: Clone, tmp_path: Path) -> None:
    cache = str(tmp_path / "cache")
    clone.run("setup", HINDRAX_CACHE=cache)
    other = replace(clone, root=tmp_path / "second[1]&clone.+*")
    copy_clone(other.root)
    details(clone)
    assert other.run("setup", HINDRAX_CACHE=cache).returncode == 0
    assert details(other) == ["kept"]
    assert (other.root / "ros_ws/install/hindrax_msgs/prefix.sh").read_text() == f"prefix {other.root}/ros_ws\n"


def test_an_edit_in_a_vehicle_file_needs_no_build(clone: Clone) -> None:
    clone.edit("src/hindrax_bringup/vehicles/second.yaml")
    clone.run("setup")
    clone.steps()
    clone.edit("src/hindrax_bringup/vehicles/second.yaml")
    clone.run("test")
    assert clone.steps() == []


def test_two_at_once_do_the_work_once(clone: Clone) -> None:
    both = [clone.start("test", BUILD_S="1") for _ in range(2)]
    output = [process.communicate(timeout=60)[1] for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert sorted(clone.steps()) == sorted(ALL_STEPS)
    assert sum("another set-up works here" in text for text in output) == 1


def test_another_interpreter_makes_another_environment_which_then_stays(clone: Clone) -> None:
    clone.run("setup")
    clone.tool("python3.12", STAND_IN)
    clone.steps()
    assert clone.run("test", HINDRAX_PYTHON="python3.12", VERSION="3.12").returncode == 0
    assert clone.steps() == ALL_STEPS
    assert clone.run("test").stderr == ""
    assert clone.run("test", HINDRAX_PYTHON="python3.12").stderr == ""
    assert clone.steps() == []


def test_a_shim_that_leads_nowhere_is_passed_over(clone: Clone) -> None:
    clone.tool("python3", "#!/bin/sh\necho 'pyenv: version 3.9 is not installed' >&2\nexit 127\n")
    clone.tool("python3.12", STAND_IN)
    assert clone.run("test", VERSION="3.12").returncode == 0


def test_a_ros_installation_is_used_when_it_is_there(clone: Clone, tmp_path: Path) -> None:
    (tmp_path / "ros").mkdir()
    (tmp_path / "ros/setup.bash").write_text("export FROM_ROS=yes\n", encoding="utf-8")
    clone.tool("colcon", STAND_IN)
    native = {"HINDRAX_ROS": str(tmp_path / "ros"), "HINDRAX_PYTHON": "python3", "VERSION": "3.12"}
    assert clone.run("test", **native).returncode == 0
    assert "native.lock" in Path(f"{clone.calls}.details").read_text(encoding="utf-8")


def test_a_vehicle_installs_less_until_all_is_wanted(clone: Clone) -> None:
    clone.run("setup")
    clone.steps()
    assert clone.run("setup", "--vehicle").returncode == 0
    assert clone.steps() == ["uv-venv", "install", "colcon", "try", "compile"]
    assert (clone.root / ".hindrax/vehicle.lock").read_text(encoding="utf-8") == "of-a-vehicle==1\n"
    assert "/vehicle.lock" in Path(f"{clone.calls}.details").read_text(encoding="utf-8").splitlines()[-1]
    assert clone.run("up").returncode == 0
    assert clone.steps() == [], "what is chosen stays chosen"
    assert clone.run("setup", "--all").returncode == 0
    assert clone.steps() == ["try", "uv-venv", "install", "colcon", "try"][1:]
    assert "/wheels.lock" in Path(f"{clone.calls}.details").read_text(encoding="utf-8").splitlines()[-1]


def test_new_sources_on_a_vehicle_are_compiled_though_nothing_has_to_be_made(clone: Clone) -> None:
    clone.run("setup", "--vehicle")
    clone.steps()
    clone.edit("src/hindrax_bringup/vehicles/second.yaml")
    assert clone.run("setup", "--vehicle").returncode == 0
    assert clone.steps()[-1] == "compile"


@pytest.mark.parametrize("name", ["wheels.lock", "native.lock"])
def test_what_a_vehicle_needs_is_whole_and_without_tools(name: str) -> None:
    script: list[str | Path] = [sys.executable, ROOT / "setup/vehicle_lock.py", ROOT / "setup" / name]
    printed = subprocess.run(script, capture_output=True, text=True, check=True).stdout
    kept = dict(re.findall(r"^([a-z][\w.-]*)(?:\[\w,]+)?==(\S+)", printed, re.MULTILINE))
    asked = re.findall(r"^([a-z][\w-]*)", (ROOT / "setup/runtime.in").read_text(encoding="utf-8"), re.MULTILINE)
    assert set(asked) - {"numpy"} <= kept.keys()
    assert not kept.keys() & {"mypy", "ruff", "pandas", "xarray", "hypothesis", "rosbags", "quadprog", "distributed"}
    # Nothing is missing that a package of this machine says it needs.
    for package in kept:
        for line in _needs(package):
            assert line in kept or (name == "native.lock" and line == "numpy"), f"{package} needs {line}"
    assert printed.count("--hash=sha256:") > len(kept)
    whole = re.findall(
        r"^[a-z][\w.-]*(?:\[[\w,]+\])?==", (ROOT / "setup" / name).read_text(encoding="utf-8"), re.MULTILINE
    )
    page = " ".join((ROOT / "docs/how-to/fly-on-the-pi.md").read_text(encoding="utf-8").split())
    assert re.search(rf"\b{len(kept)} (?:Python )?packages instead of {len(whole)}\b", page), (len(kept), len(whole))


def _needs(package: str) -> set[str]:
    """Names of what an installed package always needs; none where it is not installed or declares nothing."""
    try:
        declared = metadata.requires(package) or []
    except metadata.PackageNotFoundError:
        return set()
    named = [re.findall(r"^[\w.-]+", line)[0].lower().replace("_", "-") for line in declared if ";" not in line]
    return {name.replace(".", "-") for name in named}


def test_the_index_that_pip_uses_is_used(clone: Clone) -> None:
    clone.run("setup")
    assert "index https://mirror.invalid/simple " in Path(f"{clone.calls}.details").read_text(encoding="utf-8")


def test_everything_installed_is_checked_against_its_hash(clone: Clone) -> None:
    clone.run("setup")
    assert "--require-hashes" in Path(f"{clone.calls}.details").read_text(encoding="utf-8")


# --- What is missing -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("environment", "sentence", "package"),
    [
        ({"VERSION": "3.9", "HINDRAX_PYTHON": "python3"}, "3.11 or 3.12 is wanted", None),
        ({"VERSION": "3.13", "HINDRAX_PYTHON": "python3"}, "is 3.13", None),
        ({"HEADERS": "false"}, "no Python.h", "python3.11-dev"),
        ({"ENSUREPIP": "false", "VERSION": "3.12"}, "no ensurepip", "python3.12-venv"),
        ({"HINDRAX_PYTHON": "/nowhere/python3"}, "no Python runs", None),
        ({"HINDRAX_ROS": "/nowhere/jazzy"}, "/nowhere/jazzy holds no setup.bash", None),
    ],
)
def test_an_interpreter_or_a_ros_that_will_not_do_is_named(
    clone: Clone, environment: dict[str, str], sentence: str, package: str | None
) -> None:
    for arguments in (["setup", "--check"], ["setup"], ["pool-test"]):
        outcome = clone.run(*arguments, **environment)
        output = outcome.stdout + outcome.stderr
        assert outcome.returncode == 1
        assert sentence in output
        assert package is None or f"sudo apt install {package}" in output
    assert clone.steps() == []


def test_a_missing_compiler_is_named(clone: Clone, tmp_path: Path, path_without: Callable[..., str]) -> None:
    for name in ("c++", "cc"):
        (clone.tools / name).unlink()
    bare = path_without(tmp_path / "bare", "c++", "cc", "g++", "gcc")
    outcome = clone.run("setup", "--check", PATH=f"{clone.tools}:{bare}")
    assert outcome.returncode == 1
    assert "MISSING  compiler" in outcome.stdout
    assert "sudo apt install g++" in outcome.stdout


def test_the_real_compiler_passes(clone: Clone) -> None:
    for name in ("c++", "cc"):
        (clone.tools / name).unlink()
    assert "ok       compiler" in clone.run("setup", "--check").stdout


def test_a_full_disk_is_named_before_anything_is_made(clone: Clone) -> None:
    clone.tool("df", "#!/bin/sh\necho header\necho '/dev/vda 9000 8900 100 99% /'\n")
    outcome = clone.run("pool-test")
    assert outcome.returncode == 1
    assert "100 MB free" in outcome.stderr
    assert "2000 MB are wanted" in outcome.stderr
    assert clone.steps() == []


def test_a_place_that_colcon_does_not_bear_is_named(clone: Clone) -> None:
    clone.root = clone.root.rename(clone.root.with_name("a clone"))
    outcome = clone.run("pool-test")
    assert outcome.returncode == 1
    assert "/a clone' holds a space" in outcome.stderr
    assert clone.steps() == []


def test_a_place_that_cannot_be_written_is_named(clone: Clone) -> None:
    (clone.root / ".hindrax/lock").mkdir(parents=True)  # as little to be written as on a read-only disk
    outcome = clone.run("pool-test")
    assert outcome.returncode == 1
    assert f"may not write to {clone.root}: clone elsewhere, or sudo chown" in outcome.stderr
    assert len(outcome.stderr.splitlines()) == 1


def plain_file(link: Path) -> None:
    """As a zip archive leaves it."""
    target = str(link.readlink())
    link.unlink()
    link.write_text(target, encoding="utf-8")


@pytest.mark.parametrize("link", LINKS)
def test_a_link_that_came_as_a_plain_file_becomes_a_link_again(clone: Clone, link: str) -> None:
    plain_file(clone.root / link)
    outcome = clone.run("setup")
    assert outcome.returncode == 0
    assert f"making {link} the link that it has to be" in outcome.stderr
    assert (clone.root / link).readlink() == (ROOT / link).readlink()


def test_a_disk_without_links_is_named(clone: Clone) -> None:
    plain_file(clone.root / LINKS[0])
    clone.tool("ln", "#!/bin/sh\nexit 1\n")
    outcome = clone.run("pool-test")
    assert outcome.returncode == 1
    assert "ros_ws/src has to be a link to ../src, and none can be made there: clone with git" in outcome.stderr
    assert clone.steps() == []


def test_the_links_of_this_clone_are_those_that_are_looked_after() -> None:
    listed = subprocess.run(["git", "ls-files", "-s"], capture_output=True, text=True, check=False, cwd=ROOT)
    if listed.returncode != 0:
        pytest.skip("needs git and a clone to list the links of")
    assert {line.split("\t")[1] for line in listed.stdout.splitlines() if line.startswith("120000")} == set(LINKS)


def test_everything_missing_is_named_at_once(clone: Clone) -> None:
    clone.tool("df", "#!/bin/sh\necho header\necho '/dev/vda 9000 8900 100 99% /'\n")
    clone.tool("uname", "#!/bin/sh\necho Linux aarch64\n")
    printed = clone.run("setup", "--check", HEADERS="false", ENSUREPIP="false").stdout
    assert [line.split()[1] for line in printed.splitlines() if "MISSING" in line] == [
        "machine",
        "headers",
        "venv",
        "disk",
    ]
    assert "sudo apt install python3.11-dev python3.11-venv" in printed


@pytest.mark.parametrize(
    ("complaint", "sentence"),
    [
        ("Temporary failure in name resolution", "the package index does not answer"),
        ("error sending request for url", "the package index does not answer"),
        ("OSError: [Errno 28] No space left on device", "the disk is full"),
        ("[SSL: CERTIFICATE_VERIFY_FAILED] self-signed certificate", "pip config set global.cert FILE"),
        ("invalid peer certificate: UnknownIssuer; error sending request", "pip config set global.cert FILE"),
        ("hash mismatch for numpy", "hash mismatch for numpy"),
    ],
)
@pytest.mark.parametrize("step", ["pip", "install"])
def test_a_step_that_fails_states_why_and_can_be_repeated(
    clone: Clone, step: str, complaint: str, sentence: str
) -> None:
    outcome = clone.run("test", FAIL_IN=step, COMPLAINT=complaint)
    assert outcome.returncode == 1
    assert sentence in outcome.stderr
    assert "Traceback" not in outcome.stderr
    assert clone.run("test").returncode == 0


def test_a_failing_build_shows_its_last_lines_and_the_log(clone: Clone) -> None:
    outcome = clone.run("test", FAIL_IN="colcon", COMPLAINT="error: Heartbeat.msg: no such type")
    assert outcome.returncode == 1
    assert "    error: Heartbeat.msg: no such type" in outcome.stderr
    assert str(clone.root / ".hindrax/setup.log") in outcome.stderr


def test_what_does_not_work_when_made_is_not_kept(clone: Clone) -> None:
    broken = clone.run("test", FAIL_IN="try", COMPLAINT="ImportError: librcl.so")
    assert broken.returncode == 1
    assert "ImportError: librcl.so" in broken.stderr
    clone.steps()
    assert clone.run("test").returncode == 0
    assert clone.steps() == ALL_STEPS[2:]


def test_check_touches_nothing(clone: Clone) -> None:
    assert clone.run("setup", "--check").returncode == 1
    assert not (clone.root / ".hindrax").exists()
    clone.run("setup")
    complete = clone.run("setup", "--check")
    assert complete.returncode == 0
    assert "complete and up to date" in complete.stdout


@pytest.mark.parametrize(
    "words", [[], ["--help"], ["--version"], ["completion", "bash"], ["bag", "info", "-h"], ["test", "--help"]]
)
def test_help_version_and_completion_need_no_set_up(clone: Clone, words: list[str]) -> None:
    outcome = clone.run(*words)
    assert (outcome.returncode, outcome.stderr) == (0, "")
    assert outcome.stdout == f"answered without a set-up: {' '.join(words)}\n"
    assert clone.steps() == []
    clone.run("setup")
    assert clone.run(*words).stdout.startswith("the tool got:")


def test_a_word_that_is_no_command_is_refused_before_a_set_up(clone: Clone) -> None:
    commands = clone.root / "src/hindrax_cli/hindrax_cli/command.py"
    commands.parent.mkdir(parents=True)
    commands.write_text('GROUPS = {"the main job": {"pool.pool_flight": "pool-test report"}}')
    assert clone.run("pol-test").stdout == "answered without a set-up: pol-test\n"
    assert clone.steps() == []
    assert clone.run("pool-test").stdout.startswith("the tool got:")


def test_help_of_the_set_up_needs_nothing_at_all(clone: Clone) -> None:
    outcome = clone.run("setup", "--help")
    assert outcome.returncode == 0
    assert "Example:" in outcome.stdout
    assert clone.steps() == []


def test_wrong_use_is_reported(clone: Clone) -> None:
    outcome = clone.run("setup", "--chekc")
    assert outcome.returncode == 2
    assert "--chekc" in outcome.stderr


# --- The rest of the house -------------------------------------------------------------------------------------------


def test_continuous_integration_calls_the_test_command(clone: Clone) -> None:
    called = subprocess.run(
        [clone.root / ".ci/run"], env=clone.environment, capture_output=True, text=True, check=True, cwd="/"
    )
    assert called.stdout.startswith("the tool got: test;")


def test_the_scripts_pass_shellcheck() -> None:
    scripts = [ROOT / "hindrax", ROOT / ".ci/run", *sorted((ROOT / "setup").glob("*.sh")), *ROOT.glob("docker/**/*.sh")]
    shellcheck = Path(sys.executable).parent / "shellcheck"
    checked = subprocess.run([shellcheck, "-x", *scripts], capture_output=True, text=True, check=False, cwd=ROOT)
    assert checked.stdout == ""
    assert checked.returncode == 0


def test_the_dockerfiles_pass_hadolint() -> None:
    command = [Path(sys.executable).parent / "hadolint", *ROOT.glob("docker/**/Dockerfile")]
    checked = subprocess.run(command, capture_output=True, text=True, check=False)
    assert checked.stdout + checked.stderr == ""
    assert checked.returncode == 0
