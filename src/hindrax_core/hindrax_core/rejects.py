"""Why bytes of a device are rejected: a code to decide and count by, a sentence with what was found."""

from enum import StrEnum
from typing import Self

from hindrax_core.text.coded import Coded


class RejectCode(StrEnum):
    """Code of a reject; its word is in the key by which /diagnostics counts it, and never given to another meaning."""

    # ---- no message of the device
    NO_START = "no start of a frame"
    GARBAGE = "garbage"
    CHECKSUM = "checksum"
    NO_CHECKSUM = "no checksum"
    LENGTH = "length"
    CUT = "cut"
    UNKNOWN = "unknown"
    SIGNED = "signed, or of a later version"
    NOT_JSON = "no JSON"
    NOT_AN_OBJECT = "no object"
    NO_CONFIGURATION = "no configuration"

    # ---- a message with fields that it cannot have
    FIELD = "field"
    """The one that is named."""
    FIELDS = "fields"
    NUMBER = "number"
    FLAG = "flag"
    TEXT = "text"
    COUNT = "count"
    FORMAT = "format"
    TYPE = "type"
    TIMES = "times"

    # ---- values that no vehicle, and no sound instrument, has
    RANGE = "range"
    CONFIDENCE = "confidence"
    REPEATED = "repeated"
    OVERLAP = "overlap"
    LEAP = "leap"
    SATURATED = "saturated"
    TOO_STRONG = "field too strong (overflow)"
    TWO_DIFFER = "two reads differ"
    END_OF_SCALE = "end of the scale"
    CHANGED = "changed a moment ago"

    # ---- how the device or its bus does
    BUS = "bus"
    NO_DEVICE = "no device"
    SILENT = "silent"
    OVERFLOW = "overflow"
    OUT_OF_STEP = "out of step"
    TOO_MANY = "too many"


class Reject(Coded[RejectCode]):
    """The sentence of a reject, which knows its code and `key`, the words without numbers that it is counted by."""

    __slots__ = ("key",)
    key: str

    def __new__(cls, code: RejectCode, sentence: str, key: str = "") -> Self:
        """Make the sentence of a code; `reject` does so of its parts."""
        made = super().__new__(cls, code, sentence)
        made.key = key or sentence
        return made

    def __getnewargs__(self) -> tuple[RejectCode, str, str]:  # type: ignore[override]  # what makes a copy of it
        return self.code, str(self), self.key


def reject(code: RejectCode, part: str = "", *, field: str = "", found: str = "") -> Reject:
    """Make "part: what is wrong".

    Parameters
    ----------
    code
        Why.
    part
        Kind of the message, or part of the device; of a small set. Empty: the whole device.
    field
        Name of the field that is wrong, with `FIELD`; of a small set.
    found
        Sentence in the place of the code's word; it may have numbers, so nothing is counted by it.

    Returns
    -------
    Reject
        With "part: word" as its key.
    """
    before = f"{part}: " if part else ""
    key = before + (field or code.value)
    return Reject(code, before + found if found else key, key)
