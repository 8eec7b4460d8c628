"""Paper C, Xu, Ma, Han 2017: acceleration derivatives of a 1:4 model by a vertical planar motion mechanism."""

from collections.abc import Mapping
from itertools import chain

from hindrax_laboratory.papers.cells import Cell, Claim, Printed, Row

PAPER = "C"

TABLE: dict[str, tuple[str, str, str]] = {
    "Z_wdot, Fourier": ("-86.7", "-92.6", "-89.7"),
    "Z_wdot, direct fit": ("-87.5", "-93.1", "-90.3"),
    "M_wdot, Fourier": ("-7.98", "-8.42", "-8.20"),
    "M_wdot, direct fit": ("-8.41", "-8.95", "-8.68"),
    "Y_vdot": ("-41.9", "-45.9", "-43.9"),
    "K_vdot": ("-6.08", "-6.82", "-6.45"),
    "N_vdot": ("-6.69", "-7.95", "-7.32"),
    "Z_qdot": ("-17.9", "-16.7", "-17.3"),
    "M_qdot": ("-4.49", "-5.96", "-5.22"),
    "Y_rdot": ("-9.63", "-8.76", "-9.20"),
    "N_rdot": ("-5.88", "-5.31", "-5.60"),
}
"""At U = 0.532 and 0.751 m/s, and their mean, as printed."""
RATIOS = {"|Z_qdot / M_wdot|": ("Z_qdot", "M_wdot, Fourier", "2.11"), "|Y_rdot / N_vdot|": ("Y_rdot", "N_vdot", "1.26")}
LARGEST_DIFFERENCE_percent = Printed("6.3")


def _mean_row(name: str) -> Row:
    slow, fast, mean = TABLE[name]
    inputs = {"U = 0.532": Printed(slow), "U = 0.751": Printed(fast)}
    metres = (name[0] in "KMN") + (name[2] in "pqr")  # for a moment, and for an angular acceleration
    unit = ("kg", "kg m", "kg m^2")[metres]
    claim = Claim("mean", Printed(mean), lambda v: 0.5 * (v["U = 0.532"] + v["U = 0.751"]), unit=unit)
    return Row(PAPER, "derivatives", name, inputs, (claim,))


def _ratio_row(name: str) -> Row:
    above, below, printed = RATIOS[name]
    inputs = {"above": Printed(TABLE[above][2]), "below": Printed(TABLE[below][2])}
    claim = Claim("ratio", Printed(printed), lambda v: abs(v["above"] / v["below"]))
    return Row(PAPER, "asymmetry", name, inputs, (claim,))


def _difference_row() -> Row:
    """Largest difference of the two ways over both speeds and both coefficients that were found by both."""
    inputs: dict[str, Printed] = {}
    for name in ("Z_wdot", "M_wdot"):
        for speed in (0, 1):
            inputs[f"{name} {speed} Fourier"] = Printed(TABLE[f"{name}, Fourier"][speed])
            inputs[f"{name} {speed} direct"] = Printed(TABLE[f"{name}, direct fit"][speed])

    def largest(v: Mapping[str, float]) -> float:
        pairs = ((v[name], v[name.replace("Fourier", "direct")]) for name in inputs if name.endswith("Fourier"))
        return max(100.0 * abs(direct / fourier - 1.0) for fourier, direct in pairs)

    claim = Claim("largest difference of the two ways", LARGEST_DIFFERENCE_percent, largest, unit="%")
    return Row(PAPER, "derivatives", "Fourier against direct fit", inputs, (claim,))


def recompute() -> list[Cell]:
    """Means, ratios and the largest difference of the two ways. Tolerance: the printed digits."""
    rows = chain(map(_mean_row, TABLE), map(_ratio_row, RATIOS), [_difference_row()])
    return [cell for row in rows for cell in row.judge()]
