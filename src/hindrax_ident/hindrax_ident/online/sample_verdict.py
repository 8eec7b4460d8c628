"""Whether a sample was learned from: a code for programs, its sentence for whoever watches the estimate."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from hindrax_core.text.coded import Coded, coded


class NotLearned(StrEnum):
    """Why the estimate was not updated by a sample; `NONE` where it was."""

    NONE = ""
    NOT_LATER = "not_later"
    NO_THRUST = "no_thrust"
    OLD_THRUST = "old_thrust"
    FIRST_VELOCITY = "first_velocity"
    GAP = "gap"
    SETTLING = "settling"
    OUTLIER = "outlier"
    PHASE = "phase"
    AGAINST_THRUST = "against_thrust"
    BRAKED_BY_THRUST = "braked_by_thrust"


SENTENCES: Mapping[NotLearned, str] = {
    NotLearned.NONE: "",
    NotLearned.NOT_LATER: "its stamp is not later than the previous one",
    NotLearned.NO_THRUST: "no thrust received yet",
    NotLearned.OLD_THRUST: "the last thrust is {age_s:.1f} s old",
    NotLearned.FIRST_VELOCITY: "first velocity",
    NotLearned.GAP: "no velocity for {pause_s:.1f} s",
    NotLearned.SETTLING: "the filters are settling",
    NotLearned.OUTLIER: "outlier",
    NotLearned.PHASE: "phase {phase}",
    NotLearned.AGAINST_THRUST: "it moves against its thrust: check the sign of the wrench",
    NotLearned.BRAKED_BY_THRUST: "its thrust brakes the motion, as of a controller that holds it: push on it",
}
"""The sentence of each code."""
LEARNED = coded(SENTENCES, NotLearned.NONE)
"""The sentence of a sample that was learned from: empty."""


def not_learned(code: NotLearned, **numbers: object) -> Coded[NotLearned]:
    """Fill the sentence of a code; `numbers` are its fields."""
    return coded(SENTENCES, code, **numbers)


@dataclass(frozen=True, slots=True)
class SampleVerdict:
    """Outcome of a sample: why it was not learned from, if so, and its innovation [m/s, rad/s]."""

    reason: Coded[NotLearned] = LEARNED
    innovation: float = math.nan

    @property
    def learned(self) -> bool:
        """Whether it changed the estimate."""
        return self.reason.code is NotLearned.NONE
