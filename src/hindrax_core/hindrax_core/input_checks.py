"""Checks of what other programs send: its stamp, its publisher, and the count of what was refused.

Stamps: one rule for everything that commands the vehicle. An order that is too old may have waited in a dead link; one
from the future would override every later request. Both are refused, and so is a request without a stamp; where a
person may have typed it, the refusal names a stamp to repeat it with.

Publishers: a message does not name its sender, but the graph names the publishers. With two, neither is obeyed.
"""

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum

from hindrax_core.events import Stamp, seconds_between, to_s
from hindrax_core.text.digits import above
from hindrax_core.text.refusals import NOTHING, Reason, Refusal, refused


class StampFault(StrEnum):
    """What is wrong with a stamp; its word is counted by."""

    EXPIRED = "expired"
    FUTURE = "from the future"
    UNSTAMPED = "not stamped"
    TIMELESS = "no clock"


REMEDIES: Mapping[StampFault, str] = {
    StampFault.EXPIRED: "try again, and if that fails, relieve a busy computer or set the clocks of both machines",
    StampFault.FUTURE: "set the clocks of both machines",
    StampFault.UNSTAMPED: "stamp it with the time of the clock in use",
    StampFault.TIMELESS: "wait for the clock (/clock in mock) and try again",
}
OTHER_CLOCK = "one of the two uses the clock of a mock: add --sim-time to a command, use_sim_time to a node"
OTHER_CLOCK_S = 1e9
"""Clocks of two machines never differ by this; the time of a mock begins at zero."""
LAST = Stamp((2**31 - 1) * 10**9)
"""Latest time that a ROS stamp can carry (builtin_interfaces/Time: int32 seconds)."""
NAMELESS = "a publisher without a name"
LONGEST = 300
"""Limit of a kept sentence [characters]: invalid input may be long."""


@dataclass(frozen=True, slots=True)
class WrongStamp:
    """Reason why a stamp is refused: a kind to count by, what was found and wanted."""

    kind: StampFault
    text: str
    other_clock: bool = False

    @property
    def reason(self) -> Reason:
        """Its code: what only came late may be sent again."""
        return Reason.LATE if self.kind is StampFault.EXPIRED else Reason.CLOCK

    @property
    def sentence(self) -> str:
        """Found and wanted value, and the remedy."""
        return f"{self.text}; {self.remedy}"

    @property
    def refusal(self) -> Refusal:
        """The sentence with its code."""
        return Refusal(self.reason, self.sentence)

    @property
    def remedy(self) -> str:
        """Remedy."""
        return OTHER_CLOCK if self.other_clock else REMEDIES[self.kind]


@dataclass(frozen=True, slots=True)
class StampWindow:
    """Limits on the age of a command and on the lead of its stamp over the clock [s]."""

    oldest_s: float
    lead_s: float

    def judge(self, stamp: Stamp, now: Stamp) -> WrongStamp | None:
        """Check a stamp; None when the command is in time."""
        if stamp <= 0:
            return WrongStamp(StampFault.UNSTAMPED, f"stamped {to_s(stamp):g} s, wanted the time at which it was made")
        if now <= 0:
            return WrongStamp(StampFault.TIMELESS, "cannot be judged, because the vehicle's clock is not known yet")
        age_s = seconds_between(stamp, now)
        old = above("{} s old, wanted at most {} s", age_s, self.oldest_s, _places(self.oldest_s))
        ahead = "stamped {} s in the future, wanted at most {} s ahead of the vehicle's clock"
        early = above(ahead, -age_s, self.lead_s, _places(self.lead_s))
        if old or early:
            return WrongStamp(
                StampFault.EXPIRED if old else StampFault.FUTURE, old or early, abs(age_s) > OTHER_CLOCK_S
            )
        return None

    @property
    def of_lists(self) -> "StampWindow":
        """Window without an age limit, for lists that stay in force until replaced and may be repeated later."""
        return replace(self, oldest_s=math.inf)


ORDER = StampWindow(1.0, 0.1)
"""For orders of an operator: goals, setpoints, lists, heartbeats. Arm requests have the same limits, as knobs."""
MOCK_ORDER = StampWindow(10.0, 10.0)
"""On a mock's clock: at ten times real time a moment of the computer is a second of the vehicle, and two processes
have received the time at different moments."""


def order_window(*, mock: bool) -> StampWindow:
    """Window for orders of an operator, on the system's clock or on a mock's."""
    return MOCK_ORDER if mock else ORDER


NAMED_S = 8.0
"""Time in which an order may be repeated with the stamp that its refusal named; an arm request's number has as long."""


@dataclass(slots=True)
class TypedOrders:
    """Judges the stamps of one kind of order that a person may type: `ros2 service call` and `send_goal` stamp nothing.

    An order without a stamp is refused with one to repeat it with: the vehicle's clock, to the nanosecond. It counts
    once, and who has it asked after the vehicle named it: an order that waited in a dead link never has it (ADR 17).
    """

    window: StampWindow
    _named: Stamp | None = None

    def refusal(self, stamp: Stamp, now: Stamp) -> Refusal:
        """Return why an order is refused by its stamp: `REPEAT`, `LATE` or `CLOCK`; nothing when it is in time."""
        named = self._named
        if named is not None and stamp == named and 0.0 <= seconds_between(named, now) <= NAMED_S:
            self._named = None
            return NOTHING
        if stamp == 0 and now > 0:
            self._named = now
            sec, nanosec = divmod(now, 10**9)
            remedy = f"repeat it within {NAMED_S:g} s with stamp: {{sec: {sec}, nanosec: {nanosec}}}"
            return Refusal(Reason.REPEAT, f"not stamped, wanted the time at which it was made; {remedy}")
        wrong_stamp = self.window.judge(stamp, now)
        return wrong_stamp.refusal if wrong_stamp else NOTHING


def untimely_goal(why: Refusal) -> Refusal:
    """Refusal of a goal by its stamp; one that only came late may be sent again."""
    return why.within(f"{why.word}: the goal is ")


def impossible(stamp: Stamp) -> Refusal:
    """Return why a stamp cannot be that of a measurement on any clock (`NO_TIME`); nothing when it can."""
    if 0 <= stamp <= LAST:
        return NOTHING
    return refused(Reason.NO_TIME, found_s=to_s(stamp), latest_s=to_s(LAST))


def _places(seconds: float) -> int:
    """Decimal places that mean something."""
    return 1 if seconds >= 1.0 else 2


@dataclass(slots=True)
class SinglePublisher:
    """The one accepted publisher of a topic that any node may publish: wrenches, the state of the vehicle.

    Known by the identifier of its endpoint (GID), empty until there is one; it changes only while the thrusters are
    disarmed. Names are for sentences: two publishers may share one, and after a stall longer than the lease of the
    middleware a process no longer knows those of the others (ADR 13).
    """

    gid: str = ""
    name: str = ""

    def judge(self, publishers: Mapping[str, str], *, armed: bool) -> Refusal:
        """Look at who publishes when a message comes, and remember the one that may.

        Parameters
        ----------
        publishers
            All publishers of the topic, name by GID; the name is empty where it is not known.
        armed
            Whether the thrusters are: then another publisher than before is refused.

        Returns
        -------
        Refusal
            `PUBLISHERS` or `OTHER_PUBLISHER`; nothing when the message may be obeyed.
        """
        if len(publishers) != 1:
            listed = ", ".join(sorted(name or NAMELESS for name in publishers.values()))
            return refused(Reason.PUBLISHERS, count=len(publishers), listed=listed and f" ({listed})")
        ((gid, name),) = publishers.items()
        if armed and self.gid and self.gid != gid:
            found = f"another {self.name}" if name == self.name else name or NAMELESS
            return refused(Reason.OTHER_PUBLISHER, found=found, wanted=self.name)
        if gid != self.gid or name:
            self.gid, self.name = gid, name or NAMELESS
        return NOTHING

    def is_contested(self, publishers: Mapping[str, str]) -> bool:
        """Whether there is another publisher: nobody is obeyed before one of them is gone."""
        return bool(publishers.keys() - {self.gid}) and (bool(self.gid) or len(publishers) > 1)


def names_of_others(publishers: Mapping[str, str], own: str) -> str:
    """Names of publishers, name by GID, beside the one with our own name; empty when there is no other."""
    return ", ".join(sorted(name or NAMELESS for name in publishers.values() if name != own))


@dataclass(slots=True)
class Refusals:
    """Refusals of one node, for /diagnostics. `things` are our own names (topics, sensors), never received text."""

    counts: Counter[str] = field(default_factory=Counter)
    last: Refusal = NOTHING
    _reported: int = 0

    def add(self, thing: str, why: Refusal) -> Refusal:
        """Count a refusal and return it with the name of its thing before it."""
        self.counts[thing] += 1
        self.last = Refusal(why.reason, f"{thing}: {why}"[:LONGEST])
        return self.last

    def values(self) -> dict[str, str]:
        """Keys and values for /diagnostics; empty without refusals."""
        counted = {f"refused: {thing}": str(count) for thing, count in sorted(self.counts.items())}
        return counted | {"last refused": self.last, "last reason": self.last.reason.word} if counted else {}

    def new_refusals(self) -> list[str]:
        """Return the last sentence if anything was refused since the previous call."""
        reported, self._reported = self._reported, self.counts.total()
        return [f"refused: {self.last}"] if self._reported > reported else []
