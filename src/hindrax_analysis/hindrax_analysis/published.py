"""Results of COB-2023-1394 for the Hindrax, Table 3 and Table 4, as printed."""

from collections.abc import Mapping
from dataclasses import dataclass

Pair = tuple[float, float]
"""Value and standard deviation."""


@dataclass(frozen=True, slots=True)
class Published:
    """One row of both tables: digits of coefficients and C_D with their deviations, range of the Reynolds number."""

    k_q: str
    k_l: str
    b: str
    c_d: str
    reynolds: tuple[float, float]
    along_motion: bool = False
    """Whether b is printed along the motion, and that motion is in the negative direction of its axis."""

    @property
    def in_our_axes(self) -> Mapping[str, Pair]:
        """Value and deviation of k_q, k_l and b, along the axis: net buoyancy is positive in heave, down and up."""
        value, std = _pair(self.b)
        return {"k_q": _pair(self.k_q), "k_l": _pair(self.k_l), "b": (-value if self.along_motion else value, std)}

    @property
    def drag_coefficient(self) -> Pair:
        """C_D and its deviation [-]."""
        return _pair(self.c_d)


def _pair(printed: str) -> Pair:
    value, std = map(float, printed.split())
    return value, std


PUBLISHED: Mapping[str, Published] = {
    "surge": Published("66.48 10.20", "1.25 4.97", "-0.02 0.58", "2.28 0.21", (0.5e5, 1.1e5)),
    "sway": Published("75.31 14.54", "14.54 6.93", "-0.36 0.82", "3.70 0.33", (0.5e5, 1.1e5)),
    "heave_down": Published("93.52 6.61", "5.26 4.71", "0.77 0.73", "4.02 0.74", (0.6e5, 1.8e5)),
    "heave_up": Published("56.57 11.30", "11.84 6.97", "-0.81 0.99", "2.48 0.53", (0.4e5, 1.8e5), along_motion=True),
    "roll": Published("1.29 0.06", "-0.12 0.11", "0.006 0.044", "0.039 0.0015", (1.5e5, 4e5)),
    "pitch": Published("0.77 0.08", "-0.13 0.19", "-0.03 0.10", "0.0224 6.7e-4", (2.5e5, 5.5e5)),
    "yaw": Published("0.55 0.20", "1.47 0.50", "0.02 0.30", "0.049 0.011", (2.5e5, 6e5)),
}
"""N, N m, SI; one standard deviation."""

PAPER = "COB-2023-1394"
CITATION = "27th ABCM International Congress of Mechanical Engineering (COBEM 2023), paper 1394, tables 3 and 4"
VEHICLE = "hindrax"


def published_of(vehicle: str, motion: str) -> Published | None:
    """The paper's row for a motion; None for other vehicles than the paper's."""
    return PUBLISHED.get(motion) if vehicle.lower().startswith(VEHICLE) else None
