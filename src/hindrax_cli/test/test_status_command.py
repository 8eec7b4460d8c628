"""`hindrax status` lists what is announced on this machine, whatever started it."""

import contextlib
import errno
import json
import os
import re
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NoReturn

import pytest

from hindrax_bringup.liveness import tool_liveness
from hindrax_bringup.share_files import default_vehicle
from hindrax_bringup.stack_lock import FOLDER, UP, StackLock, announced
from hindrax_cli.command_line import main
from hindrax_cli.commands.operate import status as status_command
from hindrax_cli.commands.operate import view
from hindrax_cli.commands.operate.status import StackStatus
from hindrax_cli.commands.operate.view import kept_token
from hindrax_core.errors import HindraxError
from hindrax_operator import connection

HERE = os.getpid()
FLYING = StackLock(
    HERE, True, str(default_vehicle()), "runs/a", {"ROS_DOMAIN_ID": "7"}, purpose="pool-test", bag="runs/a/bag"
)
WAITING = replace(FLYING, pid=1, purpose=UP, mock=False, bag="", started_s=time.monotonic() - 100.0)


@pytest.fixture(autouse=True)
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    return tmp_path


def test_the_token_of_the_page_is_this_users_alone_and_survives_a_restart(runtime: Path) -> None:
    token = kept_token(read_only=False)
    assert kept_token(read_only=False) == token
    assert len(token) >= 32
    assert (runtime / "web.token").stat().st_mode & 0o077 == 0
    assert kept_token(read_only=True) != token, "who may only watch must not be let in when the page flies again"
    assert kept_token(read_only=False, new=True) != token


def test_on_a_full_disk_a_token_that_is_known_still_opens_the_page(
    runtime: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    token = kept_token(read_only=False)

    def full(*_: object, **__: object) -> NoReturn:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    monkeypatch.setattr(view, "replace_text", full)
    assert kept_token(read_only=False) == token
    with pytest.raises(HindraxError, match=r"web\.token: cannot be written \(No space left on device\); make room"):
        kept_token(read_only=False, new=True)
    assert (runtime / "web.token").read_text() == token


def listed(capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    assert main(["status", "--json"]) == 0
    found: list[dict[str, Any]] = json.loads(capsys.readouterr().out)["stacks"]
    return found


def test_nothing_that_runs_is_reported_in_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["status"]) == 0
    assert capsys.readouterr().out == "no stack is up here; start one with `./hindrax up`\n"
    assert listed(capsys) == []


def test_at_the_other_end_of_a_tether_nobody_is_ordered_to_start_a_stack(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HINDRAX_TETHER", "eth0:192.168.2.2")
    assert main(["status"]) == 0
    printed = "no stack is up here; `./hindrax monitor` shows the vehicle over the tether eth0\n"
    assert capsys.readouterr().out == printed


def test_a_folder_that_is_away_while_the_service_restarts_holds_no_stack(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(FOLDER, "/dev/null/hindrax")
    assert listed(capsys) == []


def test_a_pool_test_states_itself_what_it_does(capsys: pytest.CaptureFixture[str]) -> None:
    with tool_liveness() as beating, announced(FLYING):
        beating.beat("pool-test surge in mock: armed", {"dvl75": "no bottom lock"})
        (one,) = listed(capsys)
        assert one.pop("age_s") >= 0.0
        assert one == {
            "stack": HERE,
            "what": "pool-test surge in mock",
            "vehicle": "hindrax (mock)",
            "domain": "7",
            "thrusters": "armed",
            "health": "dvl75: no bottom lock",
            "bag": "runs/a/bag",
        }
        assert main(["status"]) == 0
        assert "runs/a/bag" in capsys.readouterr().out


def test_what_is_wrong_stands_below_the_table_and_costs_no_column(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """A single dead DVL made 34 lines of a screen of 80 columns, and took the age."""
    wrong = [f"{name}: no reading for 28.0 s; no such port; check cable and power" for name in ("dvl75", "pilot")]
    rows = [StackStatus(1, "up", "hindrax (mock)", "83", "disarmed", 42.0, "; ".join(wrong * 2))]
    status_command._show([*rows, StackStatus(2, "up", "bluerov2", "84", "armed", 7.0)])
    said = capsys.readouterr().out
    assert re.search(r"1 +│ up .* 42 │ below", said)
    assert re.search(r"2 +│ up .* 7 │ ok", said)
    assert "1: dvl75: no reading" in said
    assert said.count("check cable and") == 4


def test_what_waits_for_a_tether_is_listed_too(capsys: pytest.CaptureFixture[str]) -> None:
    with tool_liveness() as beating:
        beating.beat("waiting for the tether eth0", {"tether": "waiting for the tether eth0"})
        (one,) = listed(capsys)
    assert (one["stack"], one["what"], one["health"]) == (
        HERE,
        "waiting for the tether eth0",
        "tether: waiting for the tether eth0",
    )


@pytest.mark.parametrize("answers", [True, False])
def test_the_graph_of_a_stack_that_waits_is_asked_without_a_heartbeat(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], answers: bool
) -> None:
    @contextlib.contextmanager
    def joined(stack: StackLock, *, beating: bool) -> Iterator[Any]:
        assert stack == WAITING
        assert not beating
        if not answers:
            raise HindraxError("waited 3 s for the clock of the mock")
        health = SimpleNamespace(level=b"\x01", message="no lock")
        yield SimpleNamespace(
            awaited=lambda look, *_: look(),
            pause=lambda _: None,
            thrusters=SimpleNamespace(state="disarmed"),
            diagnostics={"hindrax: dvl75": health},
        )

    monkeypatch.setattr(connection, "joined", joined)
    with announced(WAITING):
        (one,) = listed(capsys)
    assert one["age_s"] >= 100.0
    assert one["thrusters"] == ("disarmed" if answers else "unknown")
    assert one["health"] == ("dvl75: no lock" if answers else "waited 3 s for the clock of the mock")
