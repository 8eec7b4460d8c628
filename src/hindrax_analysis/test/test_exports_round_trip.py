"""Every export is read back by an evaluator of its own, written after the simulator's equations: same force."""

import importlib.util
import math
import re
import subprocess
import sys
import types
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Literal
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_analysis.exports import fossen, gz, mujoco, python_model, stonefish, uuv, vehicle_block
from hindrax_analysis.exports.export_model import ExportModel, mean_of_directions
from hindrax_core.errors import HindraxError
from hindrax_core.knobs import build
from hindrax_core.readings import Vec6
from hindrax_core.vehicle import AXES, Drag, Hydrodynamics, Vehicle
from hindrax_ident.arrays import Array, array

VEHICLE = Vehicle("hindrax", 15.22, 0.0153, (0.59, 0.47, 0.40), center_of_buoyancy_m=(0.0, 0.0, -0.02))
CROSS: tuple[Vec6, ...] = (
    (0.0, 0.0, 0.0, 0.0, 1.5, 0.0),
    (0.0, 0.0, 0.0, 0.7, 0.0, 0.0),
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
    (-2.5, 0.0, 0.0, 0.0, 0.0, 0.0),
    (0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
)
HYDRODYNAMICS = Hydrodynamics(
    added_mass=(12.08, 19.43, 22.48, 0.25, 0.45, 0.35),
    surge=Drag(66.48, 1.25),
    sway=Drag(75.31, 14.54),
    heave=Drag(93.52, 8.5, 56.57, 8.5),
    roll=Drag(1.29, 0.0),
    pitch=Drag(0.77, 0.0),
    yaw=Drag(0.55, 1.47),
    added_mass_cross=CROSS,
)
MODEL = ExportModel(VEHICLE, HYDRODYNAMICS, (0.45, 0.45, 0.7, 1.2, 1.5, 1.7), "coefficients.yaml")
HALF_TURN = np.array([1, -1, -1, 1, -1, -1])


def drag(velocity: Array) -> Array:
    """Force of the drag on the vehicle, SNAME: against every component of its velocity."""
    k = [HYDRODYNAMICS.drag(axis).of(backward=v < 0.0) for axis, v in zip(AXES, velocity, strict=True)]
    return np.array([-(k_q * abs(v) + k_l) * v for (k_q, k_l), v in zip(k, velocity, strict=True)])


velocities = st.lists(st.floats(-2.0, 2.0), min_size=6, max_size=6).map(np.array)


def gz_damping_force(text: str, velocity_flu: Array) -> Array:
    """What gz::sim::systems::Hydrodynamics adds to the link, in x forward, y left, z up."""
    plugin = ET.fromstring(text).find(".//plugin")
    assert plugin is not None
    force = np.zeros(6)
    for i, f in enumerate("xyzkmn"):
        for j, v in enumerate("UVWPQR"):
            for k, w in enumerate("UVWPQR"):
                absolute = float(plugin.findtext(f"{f}{v}abs{w}", "0"))
                signed = float(plugin.findtext(f"{f}{v}{w}", "0"))
                force[i] += (absolute * abs(velocity_flu[k]) + signed * velocity_flu[k]) * velocity_flu[j]
            force[i] += float(plugin.findtext(f"{f}{v}", "0")) * velocity_flu[j]
    return force


@settings(max_examples=40)
@given(velocities)
def test_gazebo_damping_is_the_models_in_both_directions(velocity: Array) -> None:
    in_gazebo = gz_damping_force(gz.write(MODEL), HALF_TURN * velocity)
    assert HALF_TURN * in_gazebo == pytest.approx(drag(velocity), abs=1e-6)


def test_gazebo_signs_axis_by_axis() -> None:
    plugin = ET.fromstring(gz.write(MODEL)).find(".//plugin")
    assert plugin is not None
    for force, velocity in zip("xyzkmn", "UVWPQR", strict=True):
        assert float(plugin.findtext(f"{force}{velocity}abs{velocity}", "1")) < 0.0
        assert float(plugin.findtext(f"{force}{velocity}", "1")) <= 0.0
    assert plugin.find("xDotU") is None
    # Down is harder than up: in axes with z up, the signed part helps the way up.
    assert float(plugin.findtext("zWW", "0")) == pytest.approx(0.5 * (93.52 - 56.57))


def test_gazebo_added_mass_is_positive_in_the_inertial_and_negative_in_the_plugin() -> None:
    fluid = ET.fromstring(gz.write(MODEL)).find(".//fluid_added_mass")
    assert fluid is not None
    letters = "xyzpqr"
    matrix = np.zeros((6, 6))
    for row in range(6):
        for column in range(row, 6):
            matrix[row, column] = matrix[column, row] = float(fluid.findtext(letters[row] + letters[column], "nan"))
    sname = MODEL.added_mass
    symmetric = 0.5 * (sname + sname.T)
    acceleration = np.array([0.3, -0.2, 0.5, 0.1, 0.4, -0.6])
    assert HALF_TURN * (matrix @ (HALF_TURN * acceleration)) == pytest.approx(symmetric @ acceleration)

    heavy = replace(MODEL, vehicle=replace(VEHICLE, mass_kg=60.0, volume_m3=0.06, inertia_kgm2=(2.0, 2.0, 2.0)))
    plugin = ET.fromstring(gz.write(heavy, added_mass="plugin")).find(".//plugin")
    assert plugin is not None
    force = np.zeros(6)
    for i, f in enumerate("xyzkmn"):
        for j, v in enumerate("UVWPQR"):
            force[i] += float(plugin.findtext(f"{f}Dot{v}", "0")) * (HALF_TURN * acceleration)[j]
    assert HALF_TURN * force == pytest.approx(-sname @ acceleration)
    assert ET.fromstring(gz.write(heavy, added_mass="plugin")).find(".//fluid_added_mass") is None


def test_gazebo_model_displaces_and_weighs_what_the_vehicle_does() -> None:
    root = ET.fromstring(gz.write(MODEL))
    size = [float(word) for word in root.findtext(".//collision//size", "").split()]
    assert np.prod(size) == pytest.approx(0.0153)
    assert float(root.findtext(".//inertial/mass", "0")) == 15.22
    assert root.findtext(".//collision/pose", "").split()[2] == "0.02"  # above the origin, and z is up


SHIFTED = ExportModel(replace(VEHICLE, center_of_mass_m=(0.0, 0.0, 0.1)), HYDRODYNAMICS, MODEL.top_speed)


def test_every_format_takes_the_numbers_about_the_center_of_mass() -> None:
    """Identified about it, they are written as they are; the link of gz-sim has its origin there."""
    root = ET.fromstring(gz.write(SHIFTED))
    link = root.find(".//link")
    assert link is not None
    assert [float(word) for word in link.findtext("pose", "").split()] == [0.0, 0.0, -0.1, 0.0, 0.0, 0.0]
    assert float(link.findtext(".//fluid_added_mass/qq", "0")) == 0.45
    assert [float(word) for word in link.findtext("collision/pose", "").split()[:3]] == pytest.approx([0.0, 0.0, 0.12])
    assert float(ET.fromstring(uuv.write(SHIFTED)).findtext(".//center_of_buoyancy", "").split()[2]) == pytest.approx(
        0.12
    )
    assert yaml.safe_load(fossen.write(SHIFTED))["g"]["r_gb_m"] == pytest.approx([0.0, 0.0, -0.12])
    for text in (gz.write(SHIFTED), uuv.write(SHIFTED), stonefish.write(SHIFTED), python_model.write(SHIFTED)):
        assert "the center of mass, which lies at (0, 0, 0.1) m" in " ".join(text.replace("#", " ").split())


def test_the_plugins_added_mass_is_refused_where_it_would_explode() -> None:
    """An iteration with the previous acceleration diverges from an added mass of one mass on (gz-sim issue 1923)."""
    with pytest.raises(HindraxError, match=r"added mass is up to 1\.48 times the mass, .* explode .* use --to gz"):
        gz.write(MODEL, added_mass="plugin")
    light = replace(HYDRODYNAMICS, added_mass=(8.0, 8.0, 9.0, 0.1, 0.1, 0.1), added_mass_cross=())
    assert "0.59 times the mass: applied one step late" in gz.write(
        ExportModel(VEHICLE, light, MODEL.top_speed), "plugin"
    )


def test_fossens_matrices_are_the_models() -> None:
    block = yaml.safe_load(fossen.write(MODEL))
    assert np.array(block["M_A"]) == pytest.approx(MODEL.added_mass)
    assert np.diag(block["M_RB"])[3:] == pytest.approx(VEHICLE.inertia)
    speed = np.array([0.3, -0.2, 0.4, -0.5, 0.6, -0.7])
    side = [("astern" if v < 0.0 else "ahead") for v in speed]
    force = [
        -(block["D_l"][s][i] + block["D_q"][s][i] * abs(v)) * v
        for i, (s, v) in enumerate(zip(side, speed, strict=True))
    ]
    assert force == pytest.approx(drag(speed))


def uuv_force(text: str, velocity: Array, acceleration: Array) -> Array:
    """What HMFossen adds, in its own axes x forward, y right, z down: -D v - M_A a, D = -linear - quadratic |v|."""
    body = ET.fromstring(text).find(".//hydrodynamic_model")
    assert body is not None

    def numbers(name: str) -> Array:
        return np.array([float(word) for word in body.findtext(name, "").split()])

    damping = np.diag(-numbers("linear_damping") - numbers("quadratic_damping") * np.abs(velocity))
    return array(-damping @ velocity - numbers("added_mass").reshape(6, 6) @ acceleration)


@settings(max_examples=40)
@given(velocities, velocities)
def test_uuv_simulator_force_is_the_models(velocity: Array, acceleration: Array) -> None:
    expected = drag(velocity) - MODEL.added_mass @ acceleration
    k_q, k_l = mean_of_directions(HYDRODYNAMICS.heave)
    expected[2] = -(k_q * abs(velocity[2]) + k_l) * velocity[2] - (MODEL.added_mass @ acceleration)[2]
    text = uuv.write(MODEL)
    assert uuv_force(text, velocity, acceleration) == pytest.approx(expected, abs=1e-6)
    assert "heave has one coefficient for both directions" in text


def test_uuv_simulator_says_how_far_the_mean_of_two_directions_is_off() -> None:
    k_q, k_l = mean_of_directions(HYDRODYNAMICS.heave)
    off = []
    for speed in np.linspace(0.175, 0.7, 400):
        for own in (93.52, 56.57):
            thrust = (own * speed + 8.5) * speed
            reached = (math.sqrt(k_l**2 + 4.0 * k_q * thrust) - k_l) / (2.0 * k_q)
            off.append(abs(reached / speed - 1.0))
    assert f"terminal speeds within {100.0 * max(off):.1f} % from 0.17 to 0.7." in " ".join(uuv.write(MODEL).split())


def stonefish_force(text: str, velocity: Array, exponent: int) -> Array:
    """Drag of the external parts of a body about its center of mass, from small pieces of their faces.

    Written after Stonefish's public source: SolidEntity sums the faces of every part at their middles, and weighs
    force and moment by the part of the coefficients that lies along them; Compound adds the parts.
    """
    total = np.zeros(6)
    for part in ET.fromstring(text).findall("external_part[@type='box']"):
        edges = numbers_of(part, "dimensions", "xyz")
        c_d, c_f = (numbers_of(part, "hydrodynamics", f"{kind}_drag") for kind in ("quadratic", "viscous"))
        quadratic, viscous = [np.zeros(6)], [np.zeros(6)]
        for normal, centers, area in pieces(edges):
            flow = -(velocity[:3] + np.cross(velocity[3:], centers))
            towards = flow @ normal
            speed = np.linalg.norm(flow, axis=1) ** (exponent - 2)
            push = flow * (speed * np.maximum(0.0, -towards) * area)[:, None]
            slide = (flow - towards[:, None] * normal) * area
            for sums, piece in ((quadratic, push), (viscous, slide)):
                sums.append(np.concatenate((piece.sum(axis=0), np.cross(centers, piece).sum(axis=0))))
        for sums, coefficient, factor in ((quadratic, c_d, 500.0), (viscous, c_f, 1000.0)):
            for half in (slice(0, 3), slice(3, 6)):
                whole = np.sum(sums, axis=0)[half]
                length = float(np.linalg.norm(whole))
                if length > 0.0:
                    total[half] += factor * (np.abs(whole / length) @ coefficient) * whole
    return total


def numbers_of(part: ET.Element, name: str, attribute: str) -> Array:
    found = part.find(name)
    assert found is not None
    return np.array([float(word) for word in found.attrib[attribute].split()])


def pieces(edges: Array, count: int = 40) -> Iterator[tuple[Array, Array, float]]:
    """Normal, middles (n, 3) and area of the pieces of each face of a box."""
    steps = (np.arange(count) + 0.5) / count - 0.5
    for axis in range(3):
        one, two = (other for other in range(3) if other != axis)
        grid = np.zeros((count * count, 3))
        grid[:, one], grid[:, two] = (
            edges[i] * g.ravel() for i, g in zip((one, two), np.meshgrid(steps, steps), strict=True)
        )
        for side in (-1.0, 1.0):
            normal = np.zeros(3)
            normal[axis] = side
            yield normal, grid + 0.5 * edges[axis] * normal, edges[one] * edges[two] / count**2


@pytest.mark.parametrize("axis", range(6))
@pytest.mark.parametrize(("law", "exponent"), [("quadratic", 2), ("cubic", 3)])
def test_stonefish_resists_along_and_about_every_axis_as_its_header_says(
    axis: int, law: Literal["quadratic", "cubic"], exponent: int
) -> None:
    text, top = stonefish.write(MODEL, law), MODEL.top_speed[axis]
    stated = float(re.findall(rf"{AXES[axis]}: terminal speeds within ([0-9.]+) %", text)[0]) / 100.0
    k_q, k_l = mean_of_directions(HYDRODYNAMICS.drag(AXES[axis]))
    for speed in (0.25 * top, 0.6 * top, top, -top):
        force = stonefish_force(text, array(speed * np.eye(6)[axis]), exponent)
        wanted = -(k_q * abs(speed) + k_l) * speed
        # A speed that is wrong by so much is a force that is wrong by at most that to the power of the law.
        assert (1.0 - stated) ** exponent - 0.01 < force[axis] / wanted < (1.0 + stated) ** exponent + 0.01
        assert np.delete(force, axis) == pytest.approx(np.zeros(5), abs=1e-6)  # drag at the right height: no tilt
    assert stated < (0.05 if law == "quadratic" else 0.12)


@pytest.mark.parametrize(("law", "exponent"), [("quadratic", 2), ("cubic", 3)])
def test_stonefish_brakes_surge_by_sinking_as_its_header_says(
    law: Literal["quadratic", "cubic"], exponent: int
) -> None:
    """Run in Stonefish 1.6, a vehicle of 1 N of weight in the water lost 2 N of thrust in surge to it."""
    text = stonefish.write(MODEL, law)
    surge, sink = (0.3 * MODEL.top_speed[axis] * np.eye(6)[axis] for axis in (0, 2))
    along, across, both = (
        stonefish_force(text, array(one), exponent) for one in (surge, 0.1 * sink, surge + 0.1 * sink)
    )
    assert along[0] - both[0] > 0.5 * abs(across[2])
    assert "a drag across adds to that along, newtons to newtons" in " ".join(text.split())


def test_stonefish_body_weighs_floats_and_turns_as_the_vehicle_does() -> None:
    body = ET.fromstring(stonefish.write(SHIFTED))
    parts = [*body.findall("external_part"), *body.findall("internal_part")]
    masses = [float(numbers_of(part, "mass", "value")[0]) for part in parts]
    assert sum(masses) == pytest.approx(15.22)
    buoyant = [part for part in parts if part.attrib["buoyant"] == "true"]
    assert [np.prod(numbers_of(part, "dimensions", "xyz")) for part in buoyant] == pytest.approx([0.0153])
    hull = buoyant[0]
    center = numbers_of(hull, "compound_transform", "xyz")
    assert center == pytest.approx(VEHICLE.center_of_buoyancy_m)
    assert center + numbers_of(hull, "cg", "xyz") == pytest.approx(SHIFTED.vehicle.center_of_mass_m)
    assert numbers_of(hull, "inertia", "xyz") == pytest.approx(np.add(VEHICLE.inertia, (0.25, 0.45, 0.35)))
    sphere = body.find("external_part[@type='sphere']")
    assert sphere is not None
    # As Stonefish computes it, not as a sphere has it: run in Stonefish 1.6, it gathered speed as the header says.
    added = 2.0 / 3.0 * np.pi * 1000.0 * numbers_of(sphere, "dimensions", "radius")[0] ** 6
    assert added == pytest.approx(np.sqrt((15.22 + 12.08) * (15.22 + 22.48)) - 15.22)
    assert "surge: gathers speed 18 % slower" in stonefish.write(SHIFTED)


def test_stonefish_coefficients_are_positive_or_it_would_ignore_them() -> None:
    for part in ET.fromstring(stonefish.write(MODEL)).findall("external_part"):
        for name in ("viscous_drag", "quadratic_drag"):
            assert np.all(numbers_of(part, "hydrodynamics", name) >= 0.0)


def test_vehicle_block_is_read_back_by_the_vehicle_file() -> None:
    block = yaml.safe_load(vehicle_block.write(MODEL))["hydrodynamics"]
    assert build(Hydrodynamics, block, "block") == HYDRODYNAMICS


@pytest.fixture(scope="module")
def generated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("export") / "hindrax_model.py"
    path.write_text(python_model.write(MODEL))
    return path


@pytest.fixture(scope="module")
def module(generated: Path) -> types.ModuleType:
    spec = importlib.util.spec_from_file_location("hindrax_model", generated)
    assert spec is not None
    assert spec.loader is not None
    loaded = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


@settings(max_examples=40)
@given(velocities)
def test_python_model_drag_and_passivity(module: types.ModuleType, velocity: Array) -> None:
    assert -module.drag(velocity) == pytest.approx(drag(velocity), abs=1e-9)
    assert velocity @ module.drag(velocity) >= 0.0
    assert velocity @ module.coriolis(velocity) @ velocity == pytest.approx(0.0, abs=1e-9)


def test_python_model_acceleration_from_rest_is_force_over_total_mass(module: types.ModuleType) -> None:
    hold = module.restoring(0.0, 0.0)
    assert hold[2] == pytest.approx(0.78453, abs=1e-4)  # buoyancy exceeds weight: the thrusters must push down
    assert module.MASS[0, 0] == pytest.approx(15.22 + 12.08)
    acceleration = module.acceleration(np.zeros(6), np.zeros(3), hold + np.array([0, 10.0, 0, 0, 0, 0]))
    assert module.MASS @ acceleration == pytest.approx([0, 10.0, 0, 0, 0, 0], abs=1e-12)


def test_python_model_rights_itself(module: types.ModuleType) -> None:
    roll_moment = -module.restoring(0.2, 0.0)[3]
    assert roll_moment == pytest.approx(-0.02 * VEHICLE.buoyancy_N * np.sin(0.2))


def test_python_model_reaches_the_speed_at_which_drag_holds_the_thrust(module: types.ModuleType) -> None:
    velocity, attitude = np.zeros(6), np.zeros(3)
    for _ in range(4000):
        wrench = module.restoring(0.0, 0.0) + np.array([0, 10.0, 0, 0, 0, 0])
        velocity, attitude = module.step(velocity, attitude, wrench, 0.01)
    assert module.drag(velocity)[1] == pytest.approx(10.0, rel=1e-3)


def test_python_model_runs_with_numpy_alone(generated: Path) -> None:
    blocked = "import sys\nsys.modules['scipy'] = None\nsys.modules['hindrax_core'] = None\n"
    command = f"{blocked}import runpy\nrunpy.run_path({str(generated)!r}, run_name='__main__')"
    done = subprocess.run([sys.executable, "-c", command], capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) == 12


@pytest.mark.parametrize(
    "write",
    [gz.write, uuv.write, stonefish.write, vehicle_block.write, python_model.write, fossen.write, mujoco.write],
)
def test_every_format_states_where_it_comes_from_and_what_its_signs_are(
    write: Callable[..., str] | Callable[[ExportModel], str],
) -> None:
    text = write(MODEL)
    assert "exported by hindrax from coefficients.yaml" in text
    assert "positive" in text
