"""Why something is refused or ended early: a code for programs, a sentence for people, made in one place.

A `Refusal` is its sentence, so it can be printed, published and kept like any other; what decides by the reason reads
`reason`, never the words. The numbers are those of `hindrax_msgs/msg/Reason`, the words begin the sentences of bags and
are the `aborted_by` of JSON: neither is ever given to another reason.
"""

from collections.abc import Mapping, Sequence
from enum import IntEnum, StrEnum

from hindrax_core.text.coded import Coded


class Reason(IntEnum):
    """Code of a refusal: tens are what has to change before it is asked for again."""

    NONE = 0
    UNNAMED = 1
    """A sentence without a code, as of another version."""

    # ---- the request itself: wrong at any time
    GOAL = 10
    MOTION = 11
    LIFT = 12
    POOL = 13
    SETPOINT = 14
    FRAME = 15
    NOT_FINITE = 16
    LIMITED = 17
    """The one that is obeyed in part."""

    # ---- when and by whom it was asked: ask again, or one at a time
    LATE = 20
    CLOCK = 21
    OUT_OF_ORDER = 22
    BUSY = 23
    ELSEWHERE = 24
    REPEAT = 25
    TERMINAL = 26
    """Only a person in the terminal of the command may say so."""

    # ---- the state of the vehicle at the start
    NOT_ARMED = 30
    UNOBEYED = 31
    HEADING = 32
    FAULTED = 33
    INHIBITED = 34

    # ---- the guards of a maneuver, before it and in flight
    POOL_BOX = 40
    DEPTH_BAND = 41
    ALTITUDE_BAND = 42
    BATTERY = 43
    LEAK = 44
    TIME_OUT = 45
    THRUSTERS = 46
    ATTITUDE = 47
    SPEED = 48
    SENSOR_AGE = 49
    BLOCKED = 50
    DVL_LOCK = 51
    SETTLE = 52
    NAVIGATION = 53
    COMMISSION = 54

    # ---- from outside the maneuver
    CANCELLED = 60
    DISARMED = 61
    OPERATOR = 62
    STACK = 63
    LINK = 64
    PILOT = 65
    IDENTIFIER = 66
    RECORD = 67

    # ---- what a message says: its sender has to change
    PUBLISHERS = 70
    OTHER_PUBLISHER = 71
    FOREIGN_FRAME = 72
    MALFORMED = 73
    UNKNOWN_NAME = 74
    IMPOSSIBLE = 75
    NO_TIME = 76

    @property
    def word(self) -> str:
        """Its name as sentences and JSON have it, such as pool_box."""
        return self.name.lower()


SENSELESS = "see which sensor is silent (`./hindrax doctor`), then fly again"

REMEDIES: Mapping[Reason, str] = {
    Reason.POOL_BOX: "bring it to the middle of the pool and `./hindrax recentre` it, or correct `pool` in the "
    "vehicle file",
    Reason.DEPTH_BAND: "bring it to a depth between, or tare the depth sensor (`./hindrax depth tare`)",
    Reason.ALTITUDE_BAND: "let it rise (`./hindrax hold altitude`)",
    Reason.BATTERY: "charge the battery",
    Reason.LEAK: "surface, disarm and open the hull",
    Reason.TIME_OUT: "find what held it back (a current, a cable, a weak thruster) and fly it again",
    Reason.THRUSTERS: "repair them and `./hindrax thruster enable` them, or fly other motions",
    Reason.ATTITUDE: "bring it upright (`./hindrax hold roll 0`, `hold pitch 0`) and check its trim",
    Reason.SPEED: "let it come to rest, and check the DVL (`./hindrax monitor`); where it really was so fast, correct "
    "thrust or drag in the vehicle file",
    Reason.SENSOR_AGE: "check the sensor (`./hindrax doctor`), then fly again",
    Reason.BLOCKED: "look for a wall, a cable or a rope, bring it to the middle of the pool and `./hindrax recentre` "
    "it",
    Reason.DVL_LOCK: "give the DVL more water above a flat floor, or check it (`./hindrax doctor`)",
    Reason.SETTLE: "look for a current, a cable that pulls, or a thruster that does not push (`./hindrax monitor`)",
    Reason.NAVIGATION: SENSELESS,
    Reason.COMMISSION: "let it come to rest, check its trim and the thrusters of the file, and commission again",
}
"""What to do about each guard that finds something."""
BAROMETER = (
    "check the autopilot and its barometer in the water (`./hindrax doctor`); that of a SITL is the first, which "
    "`--set {name}.barometer:=1` takes"
)
"""Where depth is measured by the autopilot: what to check before the next flight."""
THRUSTERS_BY_HAND = (
    "no file is made for this frame: describe its thrusters by hand (docs/how-to/new-vehicle.md, Minimum for flight)"
)
"""What to do about an ArduSub whose frame has no vehicle in the box."""
HELD_UP = "find what held up that sensor, its line or this computer (`./hindrax doctor`), then fly again"
"""What to do about samples that were missing for a while."""
AIDING = "check the aids of the autopilot's estimator, a DVL or GPS and its compass (QGroundControl, EKF status)"
"""What to do instead about a velocity that only the autopilot has."""


class FarEnd(StrEnum):
    """What is known of an autopilot whose output is disarmed here."""

    DISARMED = "disarmed"
    LEFT_ARMED = "left_armed"
    TAKEN_OVER = "taken_over"


LEFT_ARMED = "the autopilot may still be armed, and is disarmed from here when it answers"
"""Behind the reason of an output that is disarmed here, but not there."""
TAKEN_OVER = "has taken over"
"""Part of the reason of an output whose vehicle somebody else has now."""
STILL_ARMED = f"; {LEFT_ARMED}"
"""The same as it stands there, true for as long as the state of the thrusters has it: no end of a flight repeats it."""


def without_state(reason: str, state: str) -> str:
    """Return why the thrusters are in a state, for a sentence that has named the state: "by request" of "disarmed"."""
    return reason.removeprefix(f"{state} ")


def state_and_reason(state: str, reason: str) -> str:
    """Return a state of the thrusters and why they are in it, where that is known: "disarmed (by request)"."""
    return f"{state} ({without_state(reason, state)})" if reason else state


def far_end(state: str, aborted: str) -> FarEnd:
    """The code of what two sentences say, which a message carries without it: why it is disarmed, why it ended."""
    if TAKEN_OVER in aborted:
        return FarEnd.TAKEN_OVER
    return FarEnd.LEFT_ARMED if LEFT_ARMED in state else FarEnd.DISARMED


SENTENCES: Mapping[Reason, str] = {
    Reason.PUBLISHERS: "found {count} publishers{listed}, wanted one",
    Reason.OTHER_PUBLISHER: "found {found}, wanted {wanted}, as when the thrusters were armed; disarm first",
    Reason.FOREIGN_FRAME: "found frame {frame!r}, of another vehicle; wanted {wanted}",
    Reason.MALFORMED: "found {found}, wanted {wanted}",
    Reason.UNKNOWN_NAME: "found no {what} {name!r}, wanted one of {known}",
    Reason.IMPOSSIBLE: "found {what} {found:g}{unit}, wanted {low:g} to {high:g}{unit}",
    Reason.NO_TIME: "stamped {found_s:g} s, wanted 0 to {latest_s:g} s",
}
"""The sentence of each reason to refuse a message, with the names and numbers behind it."""


class Refusal(Coded[Reason]):
    """The sentence of a refusal, "what was found, what was wanted; remedy", which knows its reason.

    It is false when nothing is refused (`NOTHING`).
    """

    __slots__ = ()

    @property
    def reason(self) -> Reason:
        """Its code."""
        return self.code

    @property
    def word(self) -> str | None:
        """The word of its reason, for JSON; None when nothing is refused."""
        return self.reason.word if self else None

    def within(self, before: str) -> "Refusal":
        """Return the same refusal with words before it."""
        return Refusal(self.reason, f"{before}{self}")

    def meanwhile(self, events: Sequence[str]) -> "Refusal":
        """Return the same refusal with the last thing that happened beside it; nothing stays nothing."""
        return Refusal(self.reason, f"{self}; meanwhile {events[-1]}") if self and events else self


NOTHING = Refusal(Reason.NONE, "")
CANCELLED = Refusal(Reason.CANCELLED, "cancelled: by the operator")
STOPPED = Refusal(Reason.OPERATOR, "operator: stopped by Ctrl-C")


def found(reason: Reason, text: str, remedy: str = "") -> Refusal:
    """Make the refusal of a guard.

    Parameters
    ----------
    reason
        Which guard.
    text
        What it found and wanted.
    remedy
        What to do; empty: what is usual for this reason.

    Returns
    -------
    Refusal
        "word: what was found, what was wanted; remedy".
    """
    return Refusal(reason, f"{reason.word}: {text}; {remedy or REMEDIES[reason]}")


def refused(reason: Reason, **numbers: object) -> Refusal:
    """Return the refusal of a message; `numbers`: values of the fields of its sentence, KeyError without one."""
    return Refusal(reason, SENTENCES[reason].format_map(numbers))


def unreadable(error: ValueError) -> Refusal:
    """Return why a message was refused by what reads it: the refusal in the error, else that it is malformed."""
    given = refusal_of(error)
    return Refusal(Reason.MALFORMED, given) if given.reason is Reason.UNNAMED else given


def refusal_of(error: Exception) -> Refusal:
    """Return the refusal that an error was raised with; one without a code is `UNNAMED`."""
    given = error.args[0] if error.args else ""
    return given if isinstance(given, Refusal) else Refusal(Reason.UNNAMED, str(error))


def received(code: int, sentence: str) -> Refusal:
    """Return the refusal that a message carries. A code of a later version, or none, is found by the sentence."""
    known = code != Reason.NONE and any(code == one for one in Reason)
    return Refusal(Reason(code), sentence) if known else from_sentence(sentence)


def from_sentence(sentence: str) -> Refusal:
    """Return the refusal of a sentence alone, as older records have it: its first word names the reason."""
    if not sentence:
        return NOTHING
    word = sentence.removeprefix("start: ").partition(":")[0]
    reason = Reason.__members__.get(word.upper(), Reason.UNNAMED)
    return Refusal(Reason.UNNAMED if reason is Reason.NONE else reason, sentence)
