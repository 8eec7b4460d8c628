"""Between the page and the vehicle: what the page is told, which orders are passed on, who is there to see."""

from __future__ import annotations

import json
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from http import HTTPStatus
from typing import Any, Protocol

from hindrax_bringup.monitor.draw import SILENT_s
from hindrax_bringup.monitor.watched import Picture
from hindrax_bringup.web.access import Refused
from hindrax_bringup.web.reports import Reports
from hindrax_bringup.web.summary import Chart, finite, summary
from hindrax_control.maneuvers import Goal, check_goal
from hindrax_core.errors import UsageError

PERIOD_S = 0.2
THERE_S = 1.5
"""A page that has said nothing for so long has nobody before it, or no way to here."""
TOLD = 8
SEEDS = 1 << 32

Tell = Callable[[str, bool], None]


class Vehicle(Protocol):
    """What the page watches and may order. Orders return at once and tell their outcome later, in one sentence."""

    title: str

    def picture(self) -> Picture:
        """Return everything known now."""

    def stop(self, tell: Tell) -> None:
        """Neutral, disarm, cancel."""

    def disarm(self, tell: Tell) -> None:
        """Disarm."""

    def cancel(self, tell: Tell) -> None:
        """End what is being flown."""

    def fly(self, goal: Goal, tell: Tell) -> None:
        """Fly; told when it has ended."""


class Attendance:
    """Whether somebody sees what the vehicle does: pages say so as they get the news."""

    def __init__(self) -> None:
        self._seen_s = float("-inf")

    def note(self) -> None:
        """Somebody is there."""
        self._seen_s = time.monotonic()

    def present(self) -> bool:
        """Whether somebody was there a moment ago."""
        return time.monotonic() - self._seen_s < THERE_S


class Desk:
    """Passes on orders and news for all pages together; its calls may come from any thread."""

    def __init__(
        self,
        vehicle: Vehicle,
        chart: Chart,
        reports: Reports,
        attendance: Attendance,
        *,
        read_only: bool,
        say: Callable[[str], None],
    ) -> None:
        self.reports, self.attendance, self.read_only = reports, attendance, read_only
        self._vehicle, self._chart, self._say = vehicle, chart, say
        self._lock = threading.Lock()
        self._told: deque[Mapping[str, Any]] = deque(maxlen=TOLD)
        self._number = 0
        self._flying = False
        self._news, self._news_s = "", float("-inf")

    def news(self) -> str:
        """Return what every page is told now, as JSON; made once for all of them."""
        with self._lock:
            if time.monotonic() - self._news_s >= PERIOD_S / 2:
                picture = self._vehicle.picture()
                found = summary(picture) | {
                    "title": self._vehicle.title,
                    "read_only": self.read_only,
                    "ordered": self._flying,
                    "pool": self._chart.step(picture),
                    "told": list(self._told),
                }
                self._news = json.dumps(finite(found), allow_nan=False, separators=(",", ":"))
                self._news_s = time.monotonic()
            return self._news

    def order(self, name: str, words: Mapping[str, Any]) -> None:
        """Pass an order on; Refused where it may not be, or makes no sense. Its outcome is among the news later."""
        if self.read_only:
            raise Refused(HTTPStatus.FORBIDDEN, f"{name}: this page only watches (`./hindrax web --read-only`)")
        if name == "fly":
            self._fly(goal_of(words))
            return
        if words:
            raise Refused(HTTPStatus.BAD_REQUEST, f"{name}: found {', '.join(sorted(words))}, wanted no words")
        ends = {"stop": self._vehicle.stop, "disarm": self._vehicle.disarm, "cancel": self._vehicle.cancel}
        ends[name](lambda sentence, well: self._tell(name, sentence, well))

    def _fly(self, goal: Goal) -> None:
        picture = self._vehicle.picture()
        if picture.silent_s > SILENT_s:
            raise Refused(HTTPStatus.CONFLICT, "fly: the vehicle is silent; `./hindrax doctor` says why")
        if not picture.thrusters.armed:
            raise Refused(
                HTTPStatus.CONFLICT,
                f"fly: the thrusters are {picture.thrusters.state}, wanted armed; `./hindrax arm` in a terminal first",
            )
        with self._lock:
            if self._flying:
                raise Refused(HTTPStatus.CONFLICT, "fly: a maneuver from this page is under way; cancel it first")
            self._flying = True
        self._vehicle.fly(goal, self._flown)

    def _flown(self, sentence: str, well: bool) -> None:
        self._flying = False
        self._tell("fly", sentence, well)

    def _tell(self, name: str, sentence: str, well: bool) -> None:
        self._say(f"{name}: {sentence}")
        with self._lock:
            self._number += 1
            self._told.append({"number": self._number, "sentence": f"{name}: {sentence}", "well": well})


def goal_of(words: Mapping[str, Any]) -> Goal:
    """Read a goal from a request; Refused names the word that is wrong."""
    strange = sorted(set(words) - {"motions", "excitation", "seed", "on_cancel"})
    if strange:
        raise _wrong(f"found {', '.join(strange)}, wanted motions, excitation, seed, on_cancel")
    motions, seed = words.get("motions"), words.get("seed", 1)
    if not isinstance(motions, list) or not all(isinstance(one, str) for one in motions):
        raise _wrong("motions: wanted a list of names")
    if not isinstance(seed, int) or isinstance(seed, bool) or not 0 <= seed < SEEDS:
        raise _wrong(f"seed: wanted a whole number from 0 to {SEEDS - 1}")
    if len(set(motions)) != len(motions):
        raise _wrong("motions: one is named twice")
    goal = Goal(tuple(motions), str(words.get("excitation", "plateaus")), seed, str(words.get("on_cancel", "hold")))
    try:
        check_goal(goal)
    except UsageError as error:
        raise _wrong(str(error)) from error
    return goal


def _wrong(sentence: str) -> Refused:
    return Refused(HTTPStatus.BAD_REQUEST, f"fly: {sentence}")
