"""Which wiring explains the wrenches that the thrusters gave: every thruster in every place, both ways, or none.

Each thruster was pulsed alone, and its answer is a wrench per newton with deviations. A hypothesis says which column of
the effectiveness matrix that should be, and with which sign; what a file claims is more likely beforehand than that it
is wrong, and one cause is more likely than many. So a gyroscope that is turned is believed before eight thrusters that
have all been exchanged.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np

from hindrax_control.allocation.effectiveness import Matrix
from hindrax_control.commissioning.response import Answer
from hindrax_core.rotation import matrix

RELATIVE = np.array([0.3, 0.3, 0.35, 0.25, 0.25, 0.25])
"""Deviation of an answer from the prior's, as a share of it; heave is awash at the surface."""
FLOOR = np.array([0.06, 0.06, 0.12, 0.012, 0.012, 0.012])
"""Deviation whatever the answer: trim, tether, water that moves [-, m]."""
LARGEST_MISFIT = 36.0
"""Squared deviations beyond count as these: one axis that is disturbed decides nothing alone."""
STRENGTHS = tuple(np.exp(np.linspace(math.log(0.45), math.log(2.0), 25)))
USUAL_LOG = 0.3
"""Deviation of the logarithm of a thruster's strength beforehand."""
REVERSED, MOVED, DEAD, TURNED = -3.0, -5.0, -3.0, -6.0
"""Logarithms of how likely a fault is beforehand, against none."""


@dataclass(frozen=True, slots=True)
class Wiring:
    """What the output of a thruster drives: the thruster of this index of the file, this way, this strongly; or none.

    `likelihood`: of this against all other hypotheses, 0 to 1.
    """

    drives: int | None
    sign: int
    strength: float
    likelihood: float = 0.0
    log: float = 0.0

    def column(self, B: Matrix) -> Matrix:
        """Wrench per newton commanded (6,)."""
        return np.zeros(6) if self.drives is None else self.sign * self.strength * B[:, self.drives]


def right_turns() -> tuple[Matrix, ...]:
    """The 24 rotations (3, 3) by right angles, the identity first."""
    found = []
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3)):
        turn = np.zeros((3, 3))
        for row, (column, sign) in enumerate(zip(order, signs, strict=True)):
            turn[row, column] = sign
        if np.linalg.det(turn) > 0.0:
            found.append(turn)
    return tuple(sorted(found, key=lambda turn: -float(np.trace(turn))))


RIGHT_TURNS = right_turns()


def angles_deg(turn: Matrix) -> tuple[float, float, float]:
    """Roll, pitch, yaw of a rotation (3, 3), to a tenth of a degree; at a pitch of 90 deg the roll is zero."""
    pitch = math.asin(max(-1.0, min(1.0, -float(turn[2, 0]))))
    if abs(turn[2, 0]) > 1.0 - 1e-9:
        roll, yaw = 0.0, math.atan2(-float(turn[0, 1]), float(turn[1, 1]))
    else:
        roll, yaw = math.atan2(turn[2, 1], turn[2, 2]), math.atan2(turn[1, 0], turn[0, 0])
    values = (round(math.degrees(angle), 1) + 0.0 for angle in (roll, pitch, yaw))
    roll, pitch, yaw = values
    return (roll, pitch, yaw)


def turn_of(rotation_deg: Sequence[float]) -> Matrix:
    """Rotation (3, 3) of a sensor into the body by the angles of a mount."""
    roll, pitch, yaw = (math.radians(angle) for angle in rotation_deg)
    return np.array(matrix((roll, pitch, yaw)))


def explain(index: int, answer: Answer, B: Matrix) -> Wiring:
    """Find the most likely wiring of the output of one thruster.

    Parameters
    ----------
    index
        Of the thruster in the vehicle file.
    answer
        Wrench per newton by the motion that followed its pulses, with its deviation.
    B : (6, thrusters) [-, m]
        Effectiveness by the file.

    Returns
    -------
    Wiring
        Which thruster it drives, this or the other way round, and how strongly; or none. The most likely hypothesis.
    """
    # Either it drives nothing, or one of the thrusters, one way or the other: so the likelihoods add up to one.
    found = [Wiring(None, 1, 0.0, log=DEAD + _fits(answer, np.zeros(6)))]
    found += [_drives(index, other, sign, answer, B) for other in range(B.shape[1]) for sign in (1, -1)]
    best = max(found, key=lambda one: one.log)
    total = sum(math.exp(max(-700.0, one.log - best.log)) for one in found)
    return Wiring(best.drives, best.sign, best.strength, 1.0 / total, best.log)


def _drives(index: int, other: int, sign: int, answer: Answer, B: Matrix) -> Wiring:
    """Hypothesis that an output drives another thruster, or its own, this way: with the strength that fits best.

    Before the pulses a wrong plug and a turned thruster are improbable (MOVED, REVERSED), and so is a strength far from
    the file's, by its logarithm.
    """
    beforehand = (MOVED if other != index else 0.0) + (REVERSED if sign < 0 else 0.0)
    best = max(
        (
            (_fits(answer, sign * strength * B[:, other]) - 0.5 * (math.log(strength) / USUAL_LOG) ** 2, strength)
            for strength in STRENGTHS
        ),
    )
    return Wiring(other, sign, float(best[1]), log=beforehand + best[0])


def _fits(answer: Answer, wrench: Matrix) -> float:
    """Logarithm of the likelihood of an answer when the truth is this wrench per newton."""
    deviation = np.sqrt(answer.sigma**2 + (RELATIVE * wrench) ** 2 + FLOOR**2)
    off = np.minimum(((answer.wrench - wrench) / deviation) ** 2, LARGEST_MISFIT)
    return float(np.sum(-0.5 * off - np.log(deviation / FLOOR)))
