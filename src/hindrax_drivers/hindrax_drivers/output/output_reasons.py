"""Why the thruster output is in its state, or obeys nobody: a code for programs, a sentence for `thrusters/state`."""

from collections.abc import Mapping
from enum import StrEnum

from hindrax_core.text.coded import Coded, coded


class OutputReason(StrEnum):
    """Code of a reason; `NONE` of an armed output that obeys."""

    NONE = ""
    UNNAMED = "unnamed"
    """A sentence of somebody else's: of a monitor that disarms, or of another version."""

    # ---- before it was armed
    NEW = "new"
    STARTED_AGAIN = "started_again"
    NOT_SET_UP = "not_set_up"
    WAITING = "waiting"

    # ---- what disarmed it
    REQUEST = "request"
    SILENCE = "silence"
    DISOBEYED = "disobeyed"
    OTHER_SENDER = "other_sender"
    CLOCK = "clock"
    DEVICE = "device"
    RESTORED = "restored"

    # ---- what holds it disarmed
    DEAD_MAN = "dead_man"
    LIFECYCLE = "lifecycle"
    PUBLISHERS = "publishers"

    # ---- armed, but neutral
    UNOBEYED = "unobeyed"
    NO_COMMAND = "no_command"


SENTENCES: Mapping[OutputReason, str] = {
    OutputReason.NONE: "",
    OutputReason.UNNAMED: "{sentence}",
    OutputReason.NEW: "not armed since start",
    OutputReason.STARTED_AGAIN: "not armed since {ended} and was started again",
    OutputReason.NOT_SET_UP: "the output is not set up yet",
    OutputReason.WAITING: "waiting for the ESCs",
    OutputReason.REQUEST: "disarmed by request",
    OutputReason.SILENCE: "no command for {silent_s:g} s",
    OutputReason.DISOBEYED: "no command obeyed for {silent_s:g} s: {refused}",
    OutputReason.OTHER_SENDER: "the sender of commands has restarted: arm again",
    OutputReason.CLOCK: "the clock went back by {back_s:.3g} s",
    OutputReason.DEVICE: "{found}",
    OutputReason.RESTORED: "output is back after: {fault}",
    OutputReason.DEAD_MAN: "the dead man {what}",
    OutputReason.LIFECYCLE: "{state}",
    OutputReason.PUBLISHERS: "{found}",
    OutputReason.UNOBEYED: "no command is obeyed: {refused}",
    OutputReason.NO_COMMAND: "no command arrives",
}
"""The sentence of each code; what a device or a check of the graph found speaks for itself."""
NO_REASON = coded(SENTENCES, OutputReason.NONE)
"""The sentence of an armed output that obeys: empty."""
NEW = coded(SENTENCES, OutputReason.NEW)
"""The sentence of an output that nobody has armed yet."""


def output_reason(code: OutputReason, **numbers: object) -> Coded[OutputReason]:
    """Fill the sentence of a code; `numbers` are its fields."""
    return coded(SENTENCES, code, **numbers)


def all_of(reasons: Mapping[str, Coded[OutputReason]]) -> Coded[OutputReason]:
    """Return all reasons that hold, whoever gave them, with the code of the first; `NO_REASON` when none does."""
    given = [one for one in reasons.values() if one]
    return Coded(given[0].code, "; ".join(given)) if given else NO_REASON


def from_sentence(sentence: str) -> Coded[OutputReason]:
    """Return the reason that a message carries, which has the sentence only: its beginning names the code."""
    if not sentence:
        return NO_REASON
    begins = {code: text.partition("{")[0] for code, text in SENTENCES.items()}
    fitting = [code for code, begin in begins.items() if begin and sentence.startswith(begin)]
    # The longest: "not armed since start" begins as what ended an output before does.
    return Coded(max(fitting, key=lambda code: len(begins[code]), default=OutputReason.UNNAMED), sentence)
