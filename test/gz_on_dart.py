"""gz-sim without gz-sim: a model file on its physics engine DART, with what its systems are documented to do.

Written from the public documentation alone: SDFormat 1.10 (link, inertial, fluid_added_mass), the Hydrodynamics and
Buoyancy systems of gz-sim 8, and the recipe of gz-physics for added mass on DART, which adds the matrix to the spatial
tensor of the link about its origin and applies gravity as a force at the center of mass. Axes: x forward, y left, z up.
"""

from xml.etree import ElementTree as ET

import dartpy
import numpy as np

from hindrax_ident.arrays import Array

GRAVITY_mps2 = 9.80665
FORCES, VELOCITIES, LETTERS = "xyzkmn", "UVWPQR", "xyzpqr"


def floats(text: str | None) -> list[float]:
    """Numbers of an element."""
    return [float(word) for word in (text or "").split()]


class GzModel:
    """One model of an SDF file in still water of a density, at rest and level."""

    def __init__(self, sdf: str, dt_s: float, density_kgpm3: float = 1000.0) -> None:
        root = ET.fromstring(sdf)
        link = root.find(".//link[@name='base_link']")
        assert link is not None
        self._dt_s, self._water = dt_s, density_kgpm3
        self._link = np.array(floats(link.findtext("pose", "0 0 0"))[:3])
        self._skeleton = dartpy.dynamics.Skeleton("model")
        _, self._body = self._skeleton.createFreeJointAndBodyNodePair()
        self._place_inertia(root, link)
        self._damping = self._derivatives(root)
        collision = link.find("collision")
        assert collision is not None
        self._volume = float(np.prod(floats(collision.findtext(".//size"))))
        self._center_of_volume = np.array(floats(collision.findtext("pose"))[:3])
        self._world = dartpy.simulation.World()
        self._world.setGravity(np.zeros(3))
        self._world.setTimeStep(dt_s)
        self._world.addSkeleton(self._skeleton)

    def _place_inertia(self, root: ET.Element, base: ET.Element) -> None:
        """Hull and propellers, which their joints hold, as one body about the origin of the link."""
        spatial = np.zeros((6, 6))
        for link in root.findall(".//link"):
            origin = np.array(floats(link.findtext("pose", "0 0 0"))[:3]) - self._link
            inertial = link.find("inertial")
            assert inertial is not None
            at = origin + np.array([*floats(inertial.findtext("pose")), 0.0, 0.0, 0.0][:3])
            mass = float(inertial.findtext("mass", "nan"))
            moments = {one.tag: float(one.text or "nan") for one in inertial.findall("inertia/*")}
            inertia = np.array([[moments.get("i" + "".join(sorted(r + c)), 0.0) for c in "xyz"] for r in "xyz"])
            spatial += spatial_tensor(mass, at, inertia)
        self.mass_kg = float(spatial[3, 3])
        self.center = np.array([spatial[2, 4], spatial[0, 5], spatial[1, 3]]) / self.mass_kg
        fluid = base.find("inertial/fluid_added_mass")
        if fluid is not None:
            matrix = np.array([[_pair(fluid, r, c) for c in LETTERS] for r in LETTERS])
            order = [3, 4, 5, 0, 1, 2]  # angular before linear in DART
            spatial += matrix[np.ix_(order, order)]
        inertia = dartpy.dynamics.Inertia()
        inertia.setSpatialTensor(spatial)
        self._body.setInertia(inertia)
        self._body.setGravityMode(False)

    def _derivatives(self, root: ET.Element) -> tuple[Array, Array, Array]:
        plugin = root.find(".//plugin[@name='gz::sim::systems::Hydrodynamics']")
        assert plugin is not None
        linear, absolute, signed = np.zeros((6, 6)), np.zeros((6, 6, 6)), np.zeros((6, 6, 6))
        for i, force in enumerate(FORCES):
            for j, first in enumerate(VELOCITIES):
                linear[i, j] = float(plugin.findtext(force + first, "0"))
                for k, second in enumerate(VELOCITIES):
                    absolute[i, j, k] = float(plugin.findtext(f"{force}{first}abs{second}", "0"))
                    signed[i, j, k] = float(plugin.findtext(f"{force}{first}{second}", "0"))
        return linear, absolute, signed

    @property
    def velocity(self) -> Array:
        """Velocity of the link's origin and rates, in the link's axes [m/s, rad/s]."""
        both = np.asarray(self._body.getSpatialVelocity())
        return np.concatenate((both[3:], both[:3]))

    @property
    def turn(self) -> Array:
        """Rotation of the link's axes into the world's."""
        return np.asarray(self._body.getWorldTransform().rotation())

    def step(self, wrench: Array) -> None:
        """One step with a wrench at the link's origin in its axes [N, N m]."""
        v, turn = self.velocity, self.turn
        linear, absolute, signed = self._damping
        total = np.array(wrench, dtype=float)
        total += (linear + absolute @ np.abs(v) + signed @ v) @ v
        up = turn.T @ np.array([0.0, 0.0, GRAVITY_mps2])
        for force, arm in (
            (-self.mass_kg * up, self.center),
            (self._water * self._volume * up, self._center_of_volume),
        ):
            total += np.concatenate((force, np.cross(arm, force)))
        self._body.clearExternalForces()
        self._body.addExtForce(total[:3], np.zeros(3), True, True)  # DART's own signature
        self._body.addExtTorque(total[3:], True)  # as above
        self._world.step()


def spatial_tensor(mass_kg: float, arm: Array, inertia: Array) -> Array:
    """Spatial inertia (6, 6) about a point, angular rows first, of a body whose center is at an arm from it."""
    x, y, z = arm
    S = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.block([[inertia - mass_kg * S @ S, mass_kg * S], [-mass_kg * S, mass_kg * np.eye(3)]])


def _pair(fluid: ET.Element, row: str, column: str) -> float:
    return float(fluid.findtext(row + column) or fluid.findtext(column + row) or "nan")
