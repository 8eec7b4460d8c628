"""The live view: everything is on the screen at 80 columns, and the keys order what they say."""

import asyncio
import fcntl
import math
import os
import pty
import select
import struct
import subprocess
import sys
import termios
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace as Message
from typing import Any, cast

import pytest
import web_rig
from rich.console import Console
from web_rig import FakeVehicle

from hindrax_control.hold.holds import HoldState
from hindrax_core.events import Stamp, Stamped
from hindrax_core.signals import Estimate
from hindrax_operator.monitor import draw
from hindrax_operator.monitor.app import Monitor
from hindrax_operator.monitor.graph_link import GraphLink
from hindrax_operator.snapshot import ManeuverView, NodeHealth, Snapshot, _flight, _thrusters, holds_of, snapshot

NAVIGATION = replace(
    web_rig.NAVIGATION,
    attitude_rad=(math.radians(1.2), math.radians(-3.4), math.radians(-90.0)),
    velocity_mps=(0.312, -0.004, 0.011),
)
THRUSTERS = replace(web_rig.THRUSTERS, lost_axes=())
ESTIMATE = Estimate(
    "surge",
    ("k_q", "k_l", "b", "added_mass"),
    ("",) * 4,
    (66.1, 1.31, 0.0167, 12.1),
    tuple(
        tuple(sigma**2 if row == column else 0.0 for column in range(4))
        for row, sigma in enumerate((0.4, 0.3, 0.0037, 0.46))
    ),
    812,
    812.0,
    learning=True,
    reason="",
)
FULL = Snapshot(
    time_s=123.0,
    silent_s=0.1,
    navigation=NAVIGATION,
    thrusters=THRUSTERS,
    holds=(
        HoldState("heading", True, math.radians(-90.0), math.radians(0.4)),
        HoldState("roll", False),
        HoldState("pitch", False),
        HoldState("depth", False),
        HoldState("altitude", True, 1.0, 0.02, "no echo: holding depth"),
    ),
    flight=ManeuverView("surge", "plateau", "", 0.42, 93.0, 2.1, 14.2, 0.312),
    health={
        "allocator": NodeHealth("ok", "allocating"),
        "dvl75": NodeHealth("ok", "measuring", 20.0),
        "icm20948": NodeHealth("ok", "measuring", 225.1),
        "identifier": NodeHealth("ok", "learning"),
        "ms5837": NodeHealth("ok", "measuring", 49.9),
        "navigator": NodeHealth("ok", "navigating"),
        "pilot": NodeHealth("ok", "armed"),
        "ping1d": NodeHealth("error", "no reading for 3.2 s; line is silent"),
        "thrusters": NodeHealth("ok", "armed", 50.0),
    },
    estimates={"surge": ESTIMATE, "heave_down": replace(ESTIMATE, learning=False, reason="waiting for a plateau")},
)


class Fake(FakeVehicle):
    """Tells no outcome: that comes from another thread."""

    def end(self, how: str, _tell: object) -> None:
        self.orders.append(how)


def screen(
    shown: Snapshot, keys: tuple[str, ...] = (), size: tuple[int, int] = (80, 24), scrolled: int = 0
) -> tuple[str, Fake]:
    """Text of the screen after some keys, and some times down."""
    vehicle = Fake(shown)

    async def look() -> str:
        app = Monitor(cast("GraphLink", vehicle))
        async with app.run_test(size=size) as pilot:
            await pilot.press(*keys)
            await pilot.pause()
            for _ in range(scrolled):
                await pilot.press("down")
            await pilot.pause()
            for _ in range(500):  # a busy machine is slow to pass keys on
                if len(vehicle.orders) < len(keys):
                    await pilot.pause(0.02)
            return "\n".join(
                "".join(segment.text for segment in line) for line in app.screen._compositor.render_strips()
            )

    return asyncio.run(look()), vehicle


def test_everything_is_on_a_screen_of_80_by_24() -> None:
    text, _ = screen(FULL)
    for words in (
        "ARMED",
        "heading     270.0 deg",
        "roll, pitch +1.2  -3.4 deg",
        "surge, sway +0.312  -0.004 m/s",
        "locked",
        "1640 us",
        "+15.5 N",
        "disabled",
        "at 270.0 deg",
        "no echo",
        "dvl75 20 Hz",
        "no reading for 3.2 s",
        "42 %",
        "surge plateau",
        "1 min 33 s to go",
        "66.10±0.40",
        "m_a 12.10±0.46",
        "surge      ● k_q 66.10±0.40 k_l",
        "heave_down ○ k_q",
        "STOP",
    ):
        assert words in text, words
    assert max(len(line) for line in text.splitlines()) == 80


def test_on_a_small_screen_the_state_stays_and_all_else_is_scrolled_to() -> None:
    seen = ""
    for pages in (0, 4, 8):
        text, _ = screen(FULL, size=(60, 20), scrolled=pages)
        lines = [line.rstrip() for line in text.splitlines()]
        assert "ARMED" in lines[0]
        assert "quit (ROV stays up)" in lines[-1]
        assert "\u2026" not in text
        seen += "\n".join(lines)
    for words in (
        "surge, sway +0.312  -0.004 m/s",
        "north, east +1.25  -0.33 m",
        "1900 us +15.5 N",
        "icm20948 225 Hz",
        "no reading for 3.2 s; line is silent",
        "42 %",
        "66.10±0.40",
    ):
        assert words in seen, words


REFUSAL = "refused: the vehicle is 0.31 m from the east wall, and the hold would begin 0.40 m beyond it"
REASON = "the operator was silent for 2.3 s and the link is down; arm again when it is back"
GUARD = "pool_box: 0.21 m to the north wall after braking, wanted 0.30 m; bring it to the middle of the pool"


def test_long_refusals_wrap_and_are_read_to_their_end_at_80_by_24() -> None:
    shown = replace(
        FULL,
        thrusters=replace(THRUSTERS, armed=False, state="locked", reason=REASON),
        holds=(HoldState("heading", False, note=REFUSAL), *(HoldState(one, False) for one in ("roll", "pitch"))),
        flight=ManeuverView("sway", "aborted", GUARD),
        health={"ping1d": NodeHealth("error", REFUSAL)},
    )
    text, _ = screen(shown)
    halves = [" ".join(" ".join(line[begin : begin + 40].split()) for line in text.splitlines()) for begin in (0, 40)]
    for words, place in ((REFUSAL, halves[0]), (REFUSAL, halves[1]), (REASON, " ".join(text.split()))):
        assert words in " ".join(place.split()), text
    assert GUARD in " ".join(text.split())
    assert "STOP" in text


@pytest.mark.parametrize("size", [(80, 24), (60, 40), (110, 30)])
def test_why_nothing_is_learnt_is_ordered_to_its_end(size: tuple[int, int]) -> None:
    one = replace(ESTIMATE, learning=False, reason="waiting for a plateau")
    text, _ = screen(replace(FULL, health={}, estimates={"heave_down": one}), size=size)
    assert "812 waiting for a plateau" in " ".join(text.split())


def test_nothing_is_a_negative_zero() -> None:
    still = replace(NAVIGATION, velocity_mps=(-1e-5, -1e-5, -1e-5), attitude_rad=(-1e-5, -1e-5, 0.0))
    text, _ = screen(replace(FULL, navigation=still))
    assert "surge, sway +0.000  +0.000 m/s" in text
    assert "roll, pitch +0.0  +0.0 deg" in text


def test_keys_order_what_the_footer_states() -> None:
    assert screen(FULL, ("s",))[1].orders == ["stop"]
    assert screen(FULL, ("d", "s"))[1].orders == ["disarm", "stop"]


ON_A_TERMINAL = """
import sys
from test_operator_monitor import FULL, Fake
from hindrax_operator.monitor.app import Monitor
vehicle = Fake(FULL)
code = Monitor(vehicle).run() or 0
print(*vehicle.orders, sep=",")
sys.exit(code)
"""


@pytest.mark.parametrize(("end", "code"), [(b"q", 0), (b"\x03", 130)])
def test_a_real_terminal_of_80_columns_shows_it_takes_keys_and_is_given_back(end: bytes, code: int) -> None:
    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("4H", 24, 80, 0, 0))
    before = termios.tcgetattr(theirs)
    environment = dict(
        os.environ, TERM="xterm-256color", PYTHONPATH=os.pathsep.join([str(Path(__file__).parent), *sys.path])
    )
    command = [sys.executable, "-c", ON_A_TERMINAL]
    child = subprocess.Popen(command, stdin=theirs, stdout=subprocess.PIPE, stderr=theirs, text=True, env=environment)
    try:
        shown = b""
        for key, awaited in ((b"d", b"STOP"), (b"s", b"disarming"), (end, b"stopping")):
            while awaited not in shown:
                assert select.select([ours], (), (), 60.0)[0], f"waited 60 s for {awaited!r}"
                shown += os.read(ours, 1 << 16)
            os.write(ours, key)
        while child.poll() is None:
            if select.select([ours], (), (), 0.1)[0]:
                os.read(ours, 1 << 16)
    finally:
        child.kill()
    assert child.communicate()[0] == "disarm,stop\n"
    assert child.returncode == code
    assert termios.tcgetattr(theirs) == before
    os.close(ours)
    os.close(theirs)


def test_before_anything_is_received_it_reports_it_and_can_stop_all_the_same() -> None:
    text, vehicle = screen(Snapshot(), ("s",))
    assert "no message yet" in text
    assert "no navigation solution yet" in text
    assert vehicle.orders == ["stop"]


def test_where_no_vehicle_was_ever_seen_nothing_is_said_of_its_thrusters() -> None:
    """`monitor` without a stack."""
    text, _ = screen(Snapshot(stoppable=False))
    assert "no message yet" in text
    assert "cut the power" not in text


def test_a_vehicle_that_falls_silent_is_not_shown_as_armed() -> None:
    text, _ = screen(replace(FULL, silent_s=7.4))
    assert "no message for 7 s" in text
    assert "ARMED" not in text
    assert "cut the power" not in text, "who is silent may still listen"
    text, _ = screen(replace(FULL, silent_s=7.4, stoppable=False))
    assert "no program left to stop it: if it thrusts, cut the power" in text


def test_a_stack_that_was_disarmed_before_it_ended_asks_nobody_to_cut_the_power() -> None:
    ended = replace(FULL, thrusters=replace(FULL.thrusters, armed=False, state="disarmed"), silent_s=7.4)
    text, _ = screen(replace(ended, stoppable=False))
    assert "ended, disarmed before" in text
    assert "cut the power" not in text


@pytest.mark.parametrize(("part", "shown"), [(0.0, " " * 8 + "│" + " " * 8), (1.0, " " * 8 + "│" + "█" * 8)])
def test_bars_begin_in_the_middle(part: float, shown: str) -> None:
    assert draw._bar(part, "cyan").plain == shown


def test_a_bar_astern_ends_at_the_middle() -> None:
    assert draw._bar(-0.1875, "cyan").plain == "      ▐█│        "


def test_a_hold_status_whose_lists_differ_in_length_is_read_as_far_as_they_reach() -> None:
    """A pilot of someone else, or of another version: it ended `hold` and the live view with a traceback."""
    status: Any = Message(
        axes=["depth", "roll"], engaged=[True, False], setpoints=[1.0], errors=[0.1, 0.0], notes=["", ""]
    )
    assert holds_of(status) == (HoldState("depth", True, 1.0, 0.1),)


def test_a_bar_begins_at_the_pulse_that_its_thruster_had_at_rest() -> None:
    def seen(found: Snapshot, *pulses: float, armed: bool) -> Snapshot:
        state: Any = Message(armed=armed, state="", reason="", pulses=list(pulses))
        return replace(found, thrusters=_thrusters(state, None, found.thrusters.stops_us))

    unknown = seen(Snapshot(), 1500.0, 1530.0, armed=True)
    known = seen(seen(unknown, 1490.0, 1530.0, armed=False), 1490.0, 1630.0, armed=True)
    for view, stops, bars in ((unknown, (1500.0, 1500.0), (0, 1)), (known, (1490.0, 1530.0), (0, 2))):
        console = Console(width=78)
        with console.capture() as drawn:
            console.print(draw.thrusters(view.thrusters))
        assert view.thrusters.stops_us == stops
        assert tuple(line.count("█") + line.count("▌") for line in drawn.get().splitlines()) == bars


def test_an_aborted_maneuver_names_its_guard() -> None:
    console = Console(width=78)
    with console.capture() as found:
        console.print(draw.maneuver(ManeuverView("sway", "aborted", "pool_box: 0.2 m to the north wall")))
    assert "sway aborted by pool_box: 0.2 m to the north wall" in found.get()


@pytest.mark.parametrize(
    ("phase", "now_s", "aborted"),
    [
        ("plateau", 6.0, ""),
        ("plateau", 8.0, "silence: no status for 3 s, as after a stop"),
        ("done", 60.0, ""),
    ],
)
def test_a_maneuver_that_a_stop_has_ended_does_not_look_as_if_it_flew_on(
    phase: str, now_s: float, aborted: str
) -> None:
    header = Message(stamp=Message(sec=5, nanosec=0))
    numbers = {"progress": 0.3, "remaining": 60.0, "wall_distance": math.nan, "force": 14.0, "velocity": 0.3}
    status: Any = Message(header=header, motion="surge", phase=phase, aborted="", **numbers)
    view = _flight(status, now_s)
    assert view is not None
    assert view.aborted == aborted
    console = Console(width=78)
    with console.capture() as drawn:
        console.print(draw.maneuver(view))
    assert ("to go" in drawn.get()) == (phase == "plateau" and not aborted)


def test_a_picture_is_copied_out_of_messages() -> None:
    operator: Any = Message(
        navigation=Stamped(Stamp(0), NAVIGATION),
        now=lambda: 5_000_000_000,
        thrusters=Message(armed=True, state="armed", reason="", pulses=[1500.0, 1600.0]),
        allocation=Message(
            thrusters=["L", "R"], forces=[0.0, 3.0], saturated=[False, False], disabled=["L"], lost_axes=["sway"]
        ),
        holds=Message(axes=["depth"], engaged=[True], setpoints=[1.0], errors=[0.1], notes=[""]),
        maneuver=None,
        place=None,
        stoppable=False,
        plans=Message(motions=["yaw"], plans=["yaw: 1.20 rad/s, each out and back; 24 s"]),
        diagnostics={
            "hindrax: dvl75": Message(level=b"\x01", message="slow", values=[Message(key="rate [Hz]", value="7.5")])
        },
        estimates={"surge": Stamped(Stamp(0), ESTIMATE)},
    )
    found = snapshot(operator)
    assert not found.stoppable
    assert found.time_s == 5.0
    assert (found.thrusters.names, found.thrusters.forces_N) == (("L", "R"), (0.0, 3.0))
    assert found.thrusters.disabled == ("L",)
    assert found.holds == (HoldState("depth", True, 1.0, 0.1),)
    assert found.health == {"dvl75": NodeHealth("warning", "slow", 7.5)}
    assert found.flight is None
    assert found.plans == {"yaw": "yaw: 1.20 rad/s, each out and back; 24 s"}
    assert found.estimates["surge"] is ESTIMATE


@pytest.mark.parametrize(
    ("velocity_mps", "locked", "shown"),
    [
        ((0.1, 0.0, 0.0), True, "locked"),
        ((0.1, 0.0, 0.0), False, "no bottom lock"),
        ((0.1, math.nan, 0.0), False, "no velocity"),
    ],
)
def test_a_vehicle_without_a_dvl_has_lost_no_bottom(
    velocity_mps: tuple[float, float, float], locked: bool, shown: str
) -> None:
    console = Console(width=60)
    with console.capture() as found:
        console.print(draw.state(replace(NAVIGATION, velocity_mps=velocity_mps, dvl_locked=locked)))
    assert f"DVL {shown}" in " ".join(found.get().split())
