"""A cell of a published table: printed value, recomputed value, and verdict.

Verdicts are computed. A cell *agrees* when the difference lies within what the printed digits of its
inputs allow, or within the tolerance stated for its table. Where it does not, every slip of one digit is tried: a
slip of the printed result that hits the recomputed value, or a slip of an input that brings several cells of its row
back, makes a *misprint*. All else *does not follow*.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal
from typing import Literal, TypeAlias

from hindrax_core.errors import HindraxError

Verdict: TypeAlias = Literal["agrees", "misprint", "does not follow"]
Formula: TypeAlias = Callable[[Mapping[str, float]], float]

FEWEST_DIGITS = 4
"""Significant digits a printed result must have before a one-digit slip in it is accepted."""

FEWEST_REPAIRED = 2
"""Cells that a slip in an input must explain before it is accepted."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One printed number beside its recomputation. `tolerance` is absolute."""

    paper: str
    table: str
    row: str
    quantity: str
    printed: float
    recomputed: float
    tolerance: float
    verdict: Verdict
    note: str = ""
    unit: str = ""

    @property
    def difference(self) -> float:
        """Recomputed minus printed."""
        return self.recomputed - self.printed


@dataclass(frozen=True, slots=True)
class Printed:
    """A number with its printed digits, which show the rounding."""

    text: str

    @property
    def value(self) -> float:
        """The number."""
        return float(self.text)

    @property
    def half_unit(self) -> float:
        """Half a unit of the last printed digit: the largest error of rounding."""
        exponent = Decimal(self.text).as_tuple().exponent
        return 0.5 * 10.0 ** int(exponent)

    @property
    def digits(self) -> int:
        """Count of significant digits."""
        return len(Decimal(self.text).as_tuple().digits)


@dataclass(frozen=True, slots=True)
class Claim:
    """A printed result, the formula it should follow from, and tolerances (where wider than rounding)."""

    quantity: str
    printed: Printed
    formula: Formula
    relative: float = 0.0
    absolute: float = 0.0
    note: str = ""
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Row:
    """A row of a table: printed inputs and the results claimed to follow.

    `exact` inputs carry no rounding; a slip is looked for in `suspects` alone (None: in all).
    """

    paper: str
    table: str
    name: str
    inputs: Mapping[str, Printed]
    claims: Sequence[Claim]
    exact: frozenset[str] = frozenset()
    suspects: frozenset[str] | None = None

    def judge(self) -> list[Cell]:
        """Every claim of the row with its verdict."""
        cells = [self._cell(claim) for claim in self.claims]
        wrong = [index for index, cell in enumerate(cells) if cell.verdict != "agrees"]
        if len(wrong) >= FEWEST_REPAIRED and (slip := self._slip_of_input()):
            for index in wrong:
                cells[index] = replace(cells[index], verdict="misprint", note=_joined(slip, cells[index].note))
        return cells

    @property
    def values(self) -> dict[str, float]:
        """The inputs as numbers."""
        return {name: number.value for name, number in self.inputs.items()}

    def tolerance(self, claim: Claim) -> float:
        """Rounding of the result and of every input carried through the formula, or the stated tolerance if wider."""
        carried = 0.0
        for name, number in self.inputs.items():
            if name not in self.exact:
                high = claim.formula({**self.values, name: number.value + number.half_unit})
                low = claim.formula({**self.values, name: number.value - number.half_unit})
                carried += 0.5 * abs(high - low)
        stated = max(claim.absolute, claim.relative * abs(claim.printed.value))
        return max(claim.printed.half_unit + carried, stated) * (1.0 + 1e-9)

    def _cell(self, claim: Claim) -> Cell:
        tolerance, recomputed, printed = self.tolerance(claim), claim.formula(self.values), claim.printed
        verdict: Verdict = "agrees"
        note = claim.note
        if not abs(recomputed - printed.value) <= tolerance:
            verdict, slip = slip_of_result(printed, recomputed)
            note = _joined(slip, note)
        where = self.paper, self.table, self.name, claim.quantity
        return Cell(*where, printed.value, recomputed, tolerance, verdict, note, claim.unit)

    def _slip_of_input(self) -> str:
        """Sentence about the one-digit slip of one input with which every claim of the row holds, or nothing."""
        best: tuple[float, str] | None = None
        for name in self.inputs if self.suspects is None else self.suspects:
            number = self.inputs[name]
            for kind, text in (*wrong_digits(number.text), *wrong_orders(number.text)):
                excess = replace(self, inputs={**self.inputs, name: Printed(text)}).excess()
                if excess <= 1.0 and (best is None or excess < best[0]):
                    best = (excess, f"{name} = {text} printed as {number.text} ({kind}): with it the whole row follows")
        return best[1] if best else ""

    def excess(self) -> float:
        """Largest miss of any claim, in tolerances."""
        try:
            return max(abs(c.formula(self.values) - c.printed.value) / self.tolerance(c) for c in self.claims)
        except (ArithmeticError, ValueError, HindraxError):  # a slip may make an input impossible
            return float("inf")


def slip_of_result(printed: Printed, recomputed: float) -> tuple[Verdict, str]:
    """Ask whether one slip of a digit turns a printed result into the recomputed one.

    A wrong last digit is no slip of hand but a lack of precision.

    Parameters
    ----------
    printed
        Number as the paper prints it.
    recomputed
        By us.

    Returns
    -------
    tuple[Verdict, str]
        "misprint" and its sentence when it does.
    """
    if printed.digits < FEWEST_DIGITS:
        return "does not follow", ""
    near = [
        (abs(float(text) - recomputed), kind, text)
        for kind, text in slips(printed.text)
        if abs(float(text) - recomputed) <= Printed(text).half_unit and text[:-1] != printed.text[:-1]
    ]
    if not near:
        return "does not follow", ""
    _, kind, text = min(near)
    return "misprint", f"{text} printed as {printed.text} ({kind})"


def slips(text: str) -> Iterator[tuple[str, str]]:
    """Every number that one slip of hand turns into the printed one, with the name of the slip."""
    yield from wrong_digits(text)
    yield from wrong_orders(text)
    yield from lost_digits(text)


def wrong_digits(text: str) -> Iterator[tuple[str, str]]:
    """Every number with one digit different."""
    for place in _places(text):
        for digit in "0123456789":
            if digit != text[place]:
                yield "one digit wrong", text[:place] + digit + text[place + 1 :]


def wrong_orders(text: str) -> Iterator[tuple[str, str]]:
    """Every number with one digit at another place."""
    digits = [text[place] for place in _places(text)]
    for taken in range(len(digits)):
        rest = digits[:taken] + digits[taken + 1 :]
        for put in range(len(digits)):
            moved = [*rest[:put], digits[taken], *rest[put:]]
            if moved != digits:
                letters = iter(moved)
                yield "digits in the wrong order", "".join(next(letters) if c.isdigit() else c for c in text)


def lost_digits(text: str) -> Iterator[tuple[str, str]]:
    """Every number with one digit more."""
    for place in _places(text)[1:]:
        for digit in "0123456789":
            yield "one digit lost", text[:place] + digit + text[place:]


def _places(text: str) -> list[int]:
    return [index for index, letter in enumerate(text) if letter.isdigit()]


def _joined(*notes: str) -> str:
    return "; ".join(note for note in notes if note)
