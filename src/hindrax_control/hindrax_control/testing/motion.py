"""A motion in closed form, and what a point of the body feels of it. Axes: north, east, down, and SNAME in the body."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TypeAlias

from hindrax_core.hydrostatics import GRAVITY_mps2
from hindrax_core.readings import Vec3
from hindrax_core.rotation import Matrix3, matrix, rotate

Way: TypeAlias = Callable[[float], Vec3]
ORIGIN = (0.0, 0.0, 0.0)


def vector(values: Iterable[float]) -> Vec3:
    """Three values as a vector."""
    x, y, z = values
    return (x, y, z)


def rotate_back(turn: Matrix3, one: Vec3) -> Vec3:
    """Transposed matrix times vector."""
    a, b, c = zip(*turn, strict=True)
    return rotate((a, b, c), one)


@dataclass
class Motion:
    """Position [m] and attitude (roll, pitch, yaw) [rad] by time [s]; the rest by their differences."""

    position: Way
    attitude: Way

    def rates(self, t: float, h: float = 1e-4) -> Vec3:
        """Body rates by the rotation between two close attitudes."""
        before, after = matrix(self.attitude(t - h)), matrix(self.attitude(t + h))
        columns = [rotate_back(before, rotate(after, axis)) for axis in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
        return (columns[1][2] / (2 * h), columns[2][0] / (2 * h), columns[0][1] / (2 * h))

    def point(self, t: float, lever: Vec3 = ORIGIN) -> Vec3:
        """Where a point of the body is."""
        turned = rotate(matrix(self.attitude(t)), lever)
        return vector(a + b for a, b in zip(self.position(t), turned, strict=True))

    def velocity(self, t: float, lever: Vec3 = ORIGIN, h: float = 1e-4) -> Vec3:
        """Velocity over ground of a point of the body, in body axes."""
        low, high = self.point(t - h, lever), self.point(t + h, lever)
        return rotate_back(matrix(self.attitude(t)), vector((b - a) / (2 * h) for a, b in zip(low, high, strict=True)))

    def specific_force(self, t: float, lever: Vec3 = ORIGIN, h: float = 1e-3) -> Vec3:
        """Acceleration less gravity of a point of the body, in body axes."""
        low, mid, high = (self.point(t + dt, lever) for dt in (-h, 0.0, h))
        a, b, c = ((x - 2 * y + z) / h**2 for x, y, z in zip(low, mid, high, strict=True))
        return rotate_back(matrix(self.attitude(t)), (a, b, c - GRAVITY_mps2))
