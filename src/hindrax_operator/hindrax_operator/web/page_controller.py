"""Between the page and the vehicle: updates for the page, orders for the vehicle, and whether an operator watches."""

import json
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from http import HTTPStatus

from hindrax_analysis.plain import plain
from hindrax_control.commissioning.findings import Findings, table
from hindrax_control.commissioning.picture import svg
from hindrax_control.commissioning.record import lines_to_write, proof
from hindrax_control.maneuver.goal import Goal, check_goal
from hindrax_core.errors import UsageError
from hindrax_core.vehicle import Vehicle
from hindrax_ident.online.aim import Aim, ExperimentGoal, check_experiment
from hindrax_operator.monitor.draw import SILENT_S
from hindrax_operator.monitor.graph_link import GraphLink
from hindrax_operator.snapshot import CameraFrame
from hindrax_operator.web.access import RefusedRequest
from hindrax_operator.web.day import SessionOfTheDay
from hindrax_operator.web.page import summary
from hindrax_operator.web.reports import Reports

PERIOD_S = 0.2
VIEWER_LOST_S = 1.5
"""A page that has reported nothing for this long has no viewer, or no connection."""
OUTCOMES = 8
SEEDS = 1 << 32
LARGEST_NUMBER = 1e9
"""No number of an order is as large."""


@dataclass(slots=True)
class Commissioning:
    """A commissioning from a page: what it is doing, and what the last one found, by its number."""

    number: int = 0
    saying: str = ""
    rows: list[tuple[str, str, str, str]] = field(default_factory=list)
    lines: list[str] = field(default_factory=list)
    picture: str = ""


class PageController:
    """Passes on orders and updates for all pages; its methods may be called from any thread."""

    def __init__(
        self, vehicle: GraphLink, of: Vehicle, reports: Reports, *, read_only: bool, log: Callable[[str], None]
    ) -> None:
        self.reports, self.read_only = reports, read_only
        self._day = SessionOfTheDay(reports.runs)
        self._vehicle, self._log = vehicle, log
        self._of = of
        self._pool = {"size": (of.pool.length_m, of.pool.width_m), "hull": of.envelope_m[:2]}
        self._seen_s = float("-inf")
        vehicle.present = self.is_watched
        self._lock = threading.Lock()
        self._outcomes: deque[Mapping[str, object]] = deque(maxlen=OUTCOMES)
        self._number = 0
        self._flying = False
        self._commissioned = Commissioning()
        self._update, self._updated_s = "", float("-inf")

    def update(self) -> str:
        """Return the update for every page as JSON; made once for all of them."""
        with self._lock:
            if time.monotonic() - self._updated_s >= PERIOD_S / 2:
                view = self._vehicle.snapshot()
                found = summary(view) | {
                    "title": self._vehicle.title,
                    "read_only": self.read_only,
                    "ordered": self._flying,
                    "pool": self._pool,
                    "outcomes": list(self._outcomes),
                    "session": self._day.shown(),
                    "commissioning": {"saying": self._commissioned.saying, "number": self._commissioned.number},
                }
                self._update = json.dumps(plain(found), allow_nan=False, separators=(",", ":"))
                self._updated_s = time.monotonic()
            return self._update

    def commissioning(self) -> str:
        """Return what the last commissioning from a page found, as JSON: rows, lines for the file, picture."""
        found = self._commissioned
        return json.dumps({"number": found.number, "rows": found.rows, "lines": found.lines, "picture": found.picture})

    def frame(self, camera: str) -> CameraFrame | None:
        """Return the last frame of a camera, None before its first; RefusedRequest for one that is not on the graph."""
        if camera not in self._vehicle.snapshot().cameras:
            raise RefusedRequest(HTTPStatus.NOT_FOUND, "camera: none of that name on the graph")
        return self._vehicle.frame(camera)

    def note_viewer(self) -> None:
        """Note that a page is being viewed; a viewer of a read-only page is no operator."""
        if not self.read_only:
            self._seen_s = time.monotonic()

    def is_watched(self) -> bool:
        """Whether an operator watched a moment ago: pages report that with every update."""
        return time.monotonic() - self._seen_s < VIEWER_LOST_S

    def order(self, name: str, words: Mapping[str, object]) -> None:
        """Pass an order on, or raise RefusedRequest; its outcome is part of a later update."""
        if self.read_only:
            raise RefusedRequest(HTTPStatus.FORBIDDEN, f"{name}: this page is read-only (`./hindrax web --read-only`)")
        if name == "fly":
            self._fly(goal_of(words))
            return
        if name == "answer":
            self._answer(words)
            return
        if words:
            raise RefusedRequest(
                HTTPStatus.BAD_REQUEST, f"{name}: found {', '.join(sorted(words))}, wanted no arguments"
            )
        if name == "commission":
            self._commission()
            return
        self._vehicle.end(name, lambda sentence, well: self._done(name, sentence, well))

    def _answer(self, words: Mapping[str, object]) -> None:
        """Tell the session of the day that the person has done what it asked."""
        number = words.get("number")
        if set(words) != {"number"} or not isinstance(number, int) or isinstance(number, bool):
            raise RefusedRequest(HTTPStatus.BAD_REQUEST, "answer: wanted number, that of the question")
        if not self._day.answer(number):
            raise RefusedRequest(HTTPStatus.CONFLICT, "answer: no session asks that of a page, or not any more")

    def _fly(self, goal: Goal | ExperimentGoal) -> None:
        self._begin("fly", armed=True, wanted="wanted armed; `./hindrax arm` in a terminal first")
        self._vehicle.fly(goal, lambda sentence, well: self._flown("fly", sentence, well))

    def _commission(self) -> None:
        self._begin("commission", armed=False, wanted="wanted disarmed and afloat; disarm, let it come to rest")
        self._commissioned = Commissioning(self._commissioned.number)
        self._vehicle.commission(
            self._of, self._say, self._found, lambda sentence, well: self._flown("commission", sentence, well)
        )

    def _begin(self, name: str, *, armed: bool, wanted: str) -> None:
        """Take an order that flies; RefusedRequest for a silent vehicle, in another state, or while one flies."""
        view = self._vehicle.snapshot()
        if view.silent_s > SILENT_S:
            raise RefusedRequest(HTTPStatus.CONFLICT, f"{name}: the vehicle is silent; `./hindrax doctor` says why")
        with self._lock:
            if self._flying:
                under_way = f"{name}: a maneuver from this page is under way; cancel it first"
                raise RefusedRequest(HTTPStatus.CONFLICT, under_way)
            if view.thrusters.armed is not armed:
                state = f"{name}: the thrusters are {view.thrusters.state}, {wanted}"
                raise RefusedRequest(HTTPStatus.CONFLICT, state)
            self._flying = True

    def _say(self, sentence: str) -> None:
        self._log(f"commission: {sentence}")
        self._commissioned.saying = sentence

    def _found(self, findings: Findings) -> None:
        record = proof(self._of, findings, "", datetime.now(UTC).date().isoformat())
        lines = lines_to_write(findings, record)
        number = self._commissioned.number + 1
        self._commissioned = Commissioning(number, "", table(findings), lines, svg(self._of, findings))

    def _flown(self, name: str, sentence: str, well: bool) -> None:
        self._flying = False
        self._commissioned.saying = ""
        self._done(name, sentence, well)

    def _done(self, name: str, sentence: str, well: bool) -> None:
        self._log(f"{name}: {sentence}")
        with self._lock:
            self._number += 1
            self._outcomes.append({"number": self._number, "sentence": f"{name}: {sentence}", "well": well})


def goal_of(words: Mapping[str, object]) -> Goal | ExperimentGoal:
    """Read a goal, of an experiment where it has `until` or `minutes`; RefusedRequest names an invalid key."""
    experiment = "until" in words or "minutes" in words
    known = ("motions", *(("until", "minutes") if experiment else ("excitation", "seed")), "on_cancel")
    unknown = sorted(set(words) - set(known))
    if unknown:
        raise _wrong(f"found {', '.join(unknown)}, wanted {', '.join(known)}")
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
        if experiment:
            aim = Aim(_number(words, "until"), _number(words, "minutes"))
            check_experiment(motions, aim)
            return ExperimentGoal(goal.motions, aim, goal.on_cancel)
    except UsageError as error:
        raise _wrong(str(error)) from error
    return goal


def _number(words: Mapping[str, object], name: str) -> float | None:
    if (found := words.get(name)) is None:
        return None
    if isinstance(found, bool) or not isinstance(found, (int, float)) or not abs(found) < LARGEST_NUMBER:
        raise _wrong(f"{name}: wanted a number")
    return float(found)


def _wrong(sentence: str) -> RefusedRequest:
    return RefusedRequest(HTTPStatus.BAD_REQUEST, f"fly: {sentence}")
