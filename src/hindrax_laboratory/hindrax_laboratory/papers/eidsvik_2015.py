"""Paper D, Eidsvik 2015: added mass and drag of three vehicles from their dimensions.

Only the vehicles whose printed results follow from their printed inputs are here. VideoRay Pro 4 and AC-ROV 100 are
not: their results are off by up to a factor of four.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from hindrax_core.vehicle import AXES
from hindrax_ident.model.empirical_model import PRISM_ADDED_MASS, PRISM_RATIO, Dimensions, EmpiricalModel, empirical
from hindrax_laboratory.papers.cells import Cell, Claim, Printed, Row

PAPER = "D"
INPUTS = ("length m", "height m", "width m", "front m2", "side m2", "top m2", "density")

PRISM_SIX_PRINTED = Printed("0.13")
"""Added mass of a square prism of b/a = 6 in the text of the thesis."""


@dataclass(frozen=True, slots=True)
class Table:
    """One printed table: inputs in the order of INPUTS, six results, and the relative tolerance stated for them."""

    name: str
    vehicle: str
    quantity: str
    inputs: str
    printed: str
    relative: float


NEPTUNUS_SCRIPT = "0.404 0.214 0.108 0.022256 0.086456 0.027500 1000"
NEPTUNUS_ARTICLE = "0.404 0.214 0.108 0.023112 0.086456 0.031663 1000"
SF_30K = "2.5 1.5 1.6 1.678091 1.956253 3.384000 1025"
LBV600 = "0.540 0.270 0.300 0.069063 0.103104 0.142275 1000"

ADDED, QUADRATIC, LINEAR = "added mass", "quadratic drag", "linear drag"
THESIS, ARTICLE = f"{QUADRATIC}, thesis", f"{QUADRATIC}, article"
TABLES = (
    Table(ADDED, "Neptunus", ADDED, NEPTUNUS_SCRIPT, "1.926 18.840 5.993 0.014 0.052 0.091", 0.01),
    Table(THESIS, "Neptunus", QUADRATIC, NEPTUNUS_ARTICLE, "12.459 83.2442 16.2536 0.0220 0.0552 0.1698", 0.002),
    Table(ARTICLE, "Neptunus", QUADRATIC, NEPTUNUS_ARTICLE, "12.459 83.2442 19.2536 0.0220 0.0552 0.1698", 0.002),
    Table(LINEAR, "Neptunus", LINEAR, NEPTUNUS_ARTICLE, "1.99 13.32 3.10", 0.01),
    Table(QUADRATIC, "SF-30k", QUADRATIC, SF_30K, "792.7 1093.6 1974.2 275.4 943.6 572.1", 0.0005),
    Table(ADDED, "LBV600-6", ADDED, LBV600, "10.6322 23.5517 32.7863 0.0719 0.2925 0.2736", 0.035),
    Table(QUADRATIC, "LBV600-6", QUADRATIC, LBV600, "29.6028 55.9146 83.0852 0.0773 0.4091 0.2931", 0.012),
)

RESULTS: dict[str, tuple[Callable[[EmpiricalModel], Sequence[float]], tuple[str, str]]] = {
    ADDED: (lambda model: model.added_mass, ("kg", "kg m^2")),
    QUADRATIC: (lambda model: model.quadratic_drag, ("N s^2/m^2", "N m s^2")),
    LINEAR: (lambda model: model.linear_drag, ("N s/m", "N m s")),
}
"""Six numbers of each quantity, and their unit in translation and in rotation."""


def _model(v: Mapping[str, float]) -> EmpiricalModel:
    prism = tuple(
        v.get("prism", value) if ratio == 6.0 else value
        for ratio, value in zip(PRISM_RATIO, PRISM_ADDED_MASS, strict=True)
    )
    length, height, width, front, side, top, density = (v[name] for name in INPUTS)
    # Mass enters neither added mass nor drag in translation; one kilogram stands for any.
    return empirical(Dimensions(length, width, height, 1.0, front, side, top, density, prism_added_mass=prism))


def _row(table: Table, prism: Printed | None = None) -> Row:
    inputs = {name: Printed(text) for name, text in zip(INPUTS, table.inputs.split(), strict=True)}
    if prism:
        inputs["prism"] = prism
    pick, units = RESULTS[table.quantity]

    def claim(axis: int, printed: str) -> Claim:
        name, unit = f"{table.quantity} {AXES[axis]}", units[axis // 3]
        return Claim(name, Printed(printed), lambda v: pick(_model(v))[axis], table.relative, unit=unit)

    claims = [claim(axis, printed) for axis, printed in enumerate(table.printed.split())]
    exact = frozenset(inputs)
    return Row(PAPER, table.name, table.vehicle, inputs, claims, exact, suspects=frozenset({"prism"}) & exact)


def recompute() -> list[Cell]:
    """All golden tables; projected areas and dimensions are taken as exact.

    Neptunus once more with the prism coefficient as the text prints it. Tolerance: a part in ten thousand.

    Returns
    -------
    list[Cell]
        Each with its tolerance.
    """
    again = replace(TABLES[0], name=f"added mass, prism {PRISM_SIX_PRINTED.text} as in the text", relative=1e-4)
    rows = [*map(_row, TABLES), _row(again, PRISM_SIX_PRINTED)]
    return [cell for row in rows for cell in row.judge()]
