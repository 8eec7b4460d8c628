"""What a commissioning found of each claim of the vehicle file, and the values that mend it."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from hindrax_core.vehicle import Vehicle

PROVEN, WRONG, OPEN, MEASURED = "proven", "wrong", "open", "measured"
TRIM = "trim at rest"
"""Name of the claim that it floats level."""
VERDICTS = (PROVEN, WRONG, OPEN, MEASURED)
"""A claim holds; it does not; nothing showed it; a quantity of which the file claims nothing that can be wrong."""


@dataclass(frozen=True, slots=True)
class Mend:
    """A value of the vehicle file to set: its keys (a thruster of the list by its name), and the value."""

    keys: tuple[str, ...]
    value: object

    @property
    def line(self) -> str:
        """As one says it."""
        return f"{'.'.join(self.keys)}: {_yaml(self.value)}"


@dataclass(frozen=True, slots=True)
class Finding:
    """One claim: what the file says, what was found, how sure that is (0 to 1), and what to do."""

    claim: str
    verdict: str
    claimed: str
    found: str
    likelihood: float = 1.0
    remedy: str = ""
    mends: tuple[Mend, ...] = ()


@dataclass(frozen=True, slots=True)
class Findings:
    """Result of a commissioning. `ended`: why it ended early, empty when it did not."""

    rows: tuple[Finding, ...] = ()
    ended: str = ""
    wrenches: dict[str, tuple[float, ...]] = field(default_factory=dict)
    """By thruster: the wrench per newton that it gave [-, m], for the picture."""

    @property
    def wrong(self) -> tuple[Finding, ...]:
        """Claims that do not hold."""
        return tuple(row for row in self.rows if row.verdict == WRONG)

    @property
    def open(self) -> tuple[Finding, ...]:
        """Claims that nothing showed."""
        return tuple(row for row in self.rows if row.verdict == OPEN)

    @property
    def mends(self) -> tuple[Mend, ...]:
        """Everything that mends the file."""
        return tuple(mend for row in self.rows for mend in row.mends)

    @property
    def complete(self) -> bool:
        """Whether the vehicle flies on this: nothing wrong, nothing that was not shown, not ended early."""
        return not (self.wrong or self.open or self.ended)

    @property
    def sentence(self) -> str:
        """Outcome in a line: which claims are wrong, and which were not shown."""
        kinds = {"wrong": self.wrong, "open": self.open}
        named = [f"{kind}: {', '.join(row.claim for row in rows)}" for kind, rows in kinds.items() if rows]
        return "; ".join(named) or ("it ended early" if self.ended else "everything is proven")


def table(findings: Findings) -> list[tuple[str, str, str, str]]:
    """Rows for people: verdict, claim, what the file claims, what was found with its remedy."""
    return [
        (row.verdict, row.claim, row.claimed, f"{row.found}{f'; {row.remedy}' if row.remedy else ''}")
        for row in findings.rows
    ]


def mended(vehicle: Vehicle, mends: Sequence[Mend]) -> Vehicle:
    """Return the vehicle with these values, as the file has them after `--write`."""
    for mend in mends:
        *path, key = mend.keys
        kind, *name = path or [""]
        change: dict[str, Any] = {key: tuple(mend.value) if isinstance(mend.value, list) else mend.value}
        if kind == "thrusters":
            thrusters = tuple(replace(one, **change) if one.name == name[0] else one for one in vehicle.thrusters)
            vehicle = replace(vehicle, thrusters=thrusters)
        elif kind == "sensors":
            mount = replace(vehicle.sensors[name[0]], **change)
            vehicle = replace(vehicle, sensors={**vehicle.sensors, name[0]: mount})
        elif kind == "curves":
            curve = replace(vehicle.curves[name[0]], **change)
            vehicle = replace(vehicle, curves={**vehicle.curves, name[0]: curve})
        elif not kind:
            vehicle = replace(vehicle, **change)
        else:
            vehicle = replace(vehicle, water=replace(vehicle.water, **change))
    return vehicle


def _yaml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f"[{', '.join(map(str, value))}]"
    return str(value)
