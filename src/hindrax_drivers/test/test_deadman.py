"""The dead man without processes and clocks: crash after crash, a child that hangs, one that is well, an end."""

from __future__ import annotations

import signal
import time
from collections.abc import Iterator
from typing import Any

import pytest

from hindrax_core.events import Stamp, stamp_from_s
from hindrax_drivers.nodes import deadman
from hindrax_drivers.nodes.deadman import BACK_OFF_S, HUNG_S, SILENT_S, WELL_AFTER_S, DeadMan, WatchedProcess

NOW = stamp_from_s(100.0)


class Neutral:
    """Counts what would be put on the wire."""

    def __init__(self, _settings: object) -> None:
        self.writes, self.trouble, self.waits = 0, "", 0

    def now(self) -> Stamp:
        return NOW

    def write(self) -> None:
        self.writes += 1

    def wait(self, _until: Stamp, _readable: int) -> None:
        self.waits += 1
        assert self.waits < 100, "nothing ends"

    def wake(self) -> None:
        pass

    def close(self) -> None:
        pass


class Child(WatchedProcess):
    """A child that ends with a code, at once or when it is killed."""

    def __init__(self, code: int, lived_s: float = 0.0, *, ends: bool = True) -> None:
        super().__init__(self, 0, 0, born_s=time.monotonic() - lived_s)  # type: ignore[arg-type]  # its own process
        self.code, self.ends = code, ends
        self.killed = self.asked = 0
        self.turns_left = 5

    def kill(self) -> None:
        self.killed, self.ends = self.killed + 1, True

    def send_signal(self, _number: int) -> None:
        self.asked += 1

    def listen(self, now: Stamp) -> bool:
        """Until it ends, which takes a child that is asked to some turns."""
        del now
        self.turns_left -= self.asked > 0
        return not self.ends and self.turns_left > 0

    def reassure(self, now_s: float) -> None:
        del now_s

    def reap(self) -> int:
        return self.code


@pytest.fixture
def man(monkeypatch: pytest.MonkeyPatch) -> Iterator[DeadMan]:
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    monkeypatch.setattr(deadman, "NeutralWriter", Neutral)
    settings: Any = None
    yield DeadMan(settings, [])
    for number, handler in before.items():
        signal.signal(number, handler)


def run(man: DeadMan, monkeypatch: pytest.MonkeyPatch, *children: Child) -> tuple[int, list[float]]:
    """Exit code, and how long it waited before each next child."""
    waits: list[float] = []
    left = iter(children)

    def wait(_self: DeadMan, seconds: float) -> bool:
        waits.append(seconds)
        return True

    monkeypatch.setattr(WatchedProcess, "start", lambda _arguments: next(left))
    monkeypatch.setattr(DeadMan, "_wait", wait)
    return man.run(), waits


def test_however_often_the_node_crashes_it_is_started_again_ever_later(
    man: DeadMan, monkeypatch: pytest.MonkeyPatch
) -> None:
    code, waits = run(man, monkeypatch, *[Child(1) for _ in range(8)], Child(0))
    assert (code, waits) == (0, [*BACK_OFF_S[1:], *[BACK_OFF_S[-1]] * 4])


def test_a_node_that_was_well_for_long_is_started_at_once(man: DeadMan, monkeypatch: pytest.MonkeyPatch) -> None:
    _, waits = run(man, monkeypatch, Child(1), Child(1), Child(1, lived_s=WELL_AFTER_S + 1.0), Child(1), Child(0))
    assert waits == [BACK_OFF_S[1], BACK_OFF_S[2], BACK_OFF_S[0], BACK_OFF_S[1]]


def test_a_child_that_hangs_is_killed(man: DeadMan, monkeypatch: pytest.MonkeyPatch) -> None:
    child = Child(-9, ends=False)
    child.beaten_at, child.heard_s = Stamp(NOW - stamp_from_s(HUNG_S + 0.1)), time.monotonic() - HUNG_S - 0.1
    run(man, monkeypatch, child, Child(0))
    assert child.killed == 1


@pytest.mark.parametrize(("ago_s", "heard_s"), [(HUNG_S + 1.0, 0.0), (HUNG_S - 1.0, HUNG_S + 1.0)])
def test_one_clock_alone_does_not_tell_that_a_child_hangs(ago_s: float, heard_s: float) -> None:
    child = Child(0)
    child.beaten_at, child.heard_s = Stamp(NOW - stamp_from_s(ago_s)), time.monotonic() - heard_s
    assert not child.hung(NOW)


def test_a_child_that_never_beat_is_starting_and_has_not_hung() -> None:
    child = Child(0)
    child.heard_s = time.monotonic() - 10.0 * HUNG_S
    assert not child.hung(NOW)
    assert child.silent_from(NOW) == NOW


def test_silence_begins_a_moment_after_the_last_beat_and_at_once_when_the_clock_went_back() -> None:
    child = Child(0)
    child.beaten_at = NOW
    assert child.silent_from(NOW) == NOW + stamp_from_s(SILENT_S)
    child.beaten_at = Stamp(NOW + 1)
    assert child.silent_from(NOW) == NOW


def test_an_order_to_end_goes_to_the_child_once_and_neutral_is_last(
    man: DeadMan, monkeypatch: pytest.MonkeyPatch
) -> None:
    child = Child(-15, ends=False)
    man._ask(signal.SIGTERM, None)
    code, waits = run(man, monkeypatch, child)
    assert (code, waits, child.asked) == (0, [], 1)
    neutral: Any = man._neutral
    assert neutral.writes >= 3
    neutral.trouble = "no bus"
    assert run(man, monkeypatch, Child(-15, ends=False))[0] == 1, "neutral is not on the wire"
