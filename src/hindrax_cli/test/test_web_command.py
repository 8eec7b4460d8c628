"""`./hindrax web`: where it serves, what is in the way, and the address that it tells."""

import socket
import threading
from pathlib import Path

import pytest

from hindrax_bringup.stack_lock import FOLDER
from hindrax_cli.command_line import main
from hindrax_cli.commands.operate.view import page_url, qr_code, startup_text
from hindrax_operator.monitor.graph_link import GraphLink
from hindrax_operator.snapshot import Snapshot
from hindrax_operator.web import http_server

ADDRESS = "127.0.0.1"


@pytest.mark.parametrize(
    ("address", "words"),
    [("0.0.0.0", "every interface"), ("vehicle.local", "in numbers"), ("", "found nothing, wanted a value")],
)
def test_an_address_that_cannot_be_served_is_wrong_use(
    address: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["web", "--address", address]) == 2
    assert words in capsys.readouterr().err


def test_a_port_that_is_taken_or_is_none_is_named_with_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    with socket.create_server((ADDRESS, 0)) as taken:
        port = taken.getsockname()[1]
        assert main(["web", "--port", str(port)]) == 1
    assert (
        f"port {port} of 127.0.0.1 is taken by another program; name a free one with --port" in capsys.readouterr().err
    )
    assert main(["web", "--address", "192.0.2.1"]) == 1  # reserved for documentation: nobody has it
    assert "not an address of this machine" in capsys.readouterr().err


def test_no_vehicle_is_named_with_the_remedy(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    monkeypatch.setattr("hindrax_cli.commands.operate.view.VEHICLE_S", 0.1)
    monkeypatch.setattr(GraphLink, "run", lambda _link: None)
    assert main(["web", "--port", "0"]) == 1
    printed = capsys.readouterr().err
    assert printed.startswith("no `./hindrax up` runs here; looking in the ROS graph of this terminal\n")
    assert "flies" not in printed, "there is no vehicle"
    assert "start one with `./hindrax up`" in printed


def test_a_server_that_ends_by_itself_ends_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(FOLDER, str(tmp_path))
    over = threading.Event()
    monkeypatch.setattr(GraphLink, "wait", lambda _link, _seconds: None)
    monkeypatch.setattr(GraphLink, "run", lambda _link: over.wait(20.0))
    monkeypatch.setattr(GraphLink, "snapshot", lambda _link: Snapshot(silent_s=0.1))
    monkeypatch.setattr(GraphLink, "close", lambda _link: over.set())
    monkeypatch.setattr(http_server.Server, "run", lambda _server: None)
    assert main(["web", "--port", "0"]) == 1
    assert "restart `./hindrax web`" in capsys.readouterr().err


def test_a_qr_code_is_square_with_its_three_corners_and_a_quiet_edge_in_any_color() -> None:
    lines = qr_code(page_url("192.168.2.2", 8480, "x" * 32)).splitlines()
    text = [line.removeprefix("  \x1b[38;5;16;48;5;231m").removesuffix("\x1b[0m") for line in lines]
    rows = [[cell in top for cell in line] for line in text for top in ("▀█", "▄█")][: len(text[0])]
    edge, count = 4, len(rows)
    assert count < 60, "wider than a terminal"
    assert all(len(row) == count for row in rows)
    # ISO/IEC 18004: a quiet zone of four modules, then in three corners a frame of seven with a core of three in it.
    assert not any(any(row[:edge]) or any(row[-edge:]) for row in rows)
    assert not any(any(row) for row in (*rows[:edge], *rows[-edge:]))
    finder = [[max(abs(x - 3), abs(y - 3)) != 2 for x in range(7)] for y in range(7)]
    far = count - edge - 7
    for left, top in ((edge, edge), (far, edge), (edge, far)):
        assert [row[left : left + 7] for row in rows[top : top + 7]] == finder


def test_the_address_is_reported_with_the_token_where_no_server_sees_it() -> None:
    here = startup_text("127.0.0.1", 8480, "abc", read_only=False)
    assert here.splitlines()[0] == "web: http://127.0.0.1:8480/#abc"
    assert "ssh -L 8480:localhost:8480" in here
    there = startup_text("192.168.2.2", 1, "abc", read_only=True)
    assert "unencrypted" in there
    assert "stop" not in there
    assert "http://[fe80::1]:1/#abc" in startup_text("fe80::1", 1, "abc", read_only=True)
