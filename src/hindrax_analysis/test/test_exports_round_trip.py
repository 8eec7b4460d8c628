"""Every export is read back by an evaluator of its own, written after the simulator's equations: same force."""

import importlib.util
import subprocess
import sys
import types
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from hindrax_analysis.exports import gz, python_model, stonefish, uuv, vehicle_block
from hindrax_analysis.exports.export_model import ExportModel, mean_of_directions
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

    plugin = ET.fromstring(gz.write(MODEL, added_mass="plugin")).find(".//plugin")
    assert plugin is not None
    force = np.zeros(6)
    for i, f in enumerate("xyzkmn"):
        for j, v in enumerate("UVWPQR"):
            force[i] += float(plugin.findtext(f"{f}Dot{v}", "0")) * (HALF_TURN * acceleration)[j]
    assert HALF_TURN * force == pytest.approx(-sname @ acceleration)
    assert ET.fromstring(gz.write(MODEL, added_mass="plugin")).find(".//fluid_added_mass") is None


def test_gazebo_model_displaces_and_weighs_what_the_vehicle_does() -> None:
    root = ET.fromstring(gz.write(MODEL))
    size = [float(word) for word in root.findtext(".//collision//size", "").split()]
    assert np.prod(size) == pytest.approx(0.0153)
    assert float(root.findtext(".//inertial/mass", "0")) == 15.22
    assert root.findtext(".//collision/pose", "").split()[2] == "0.02"  # above the origin, and z is up


def test_added_mass_is_carried_to_the_center_of_mass() -> None:
    shifted = Vehicle("v", 15.22, 0.0153, (0.59, 0.47, 0.40), center_of_mass_m=(0.0, 0.0, 0.1))
    plain = Hydrodynamics(added_mass=(12.0, 19.0, 22.0, 0.2, 0.4, 0.3))
    fluid = ET.fromstring(gz.write(ExportModel(shifted, plain, MODEL.top_speed))).find(".//fluid_added_mass")
    assert fluid is not None
    # About a point 0.1 m below, turning in pitch at that point drags the origin along: 12 x 0.1^2 more inertia.
    assert float(fluid.findtext("qq", "0")) == pytest.approx(0.4 + 12.0 * 0.01)
    assert abs(float(fluid.findtext("xq", "0"))) == pytest.approx(1.2)


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


def stonefish_force(text: str, axis: int, speed: float, exponent: int) -> float:
    """Drag of a box moving along one of its axes, from its faces, as SolidEntity sums them."""
    body = ET.fromstring(text)

    def numbers(name: str, attribute: str) -> list[float]:
        found = body.find(name)
        assert found is not None
        return [float(word) for word in found.attrib[attribute].split()]

    edges = numbers("dimensions", "xyz")
    c_f = numbers("hydrodynamics", "viscous_drag")[axis]
    c_d = numbers("hydrodynamics", "quadratic_drag")[axis]
    force = 0.0
    for normal in range(3):
        area = edges[(normal + 1) % 3] * edges[(normal + 2) % 3]
        for _side in range(2):
            if normal != axis:
                force -= 1000.0 * c_f * area * speed
        if normal == axis:  # one of the two faces meets the water
            force -= 0.5 * 1000.0 * c_d * area * speed * abs(speed) ** (exponent - 1)
    return force


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_stonefish_drag_along_the_axes(axis: int) -> None:
    drag = Drag(*mean_of_directions(HYDRODYNAMICS.drag(AXES[axis])))
    top = MODEL.top_speed[axis]
    exact, fitted = stonefish.write(MODEL, "quadratic"), stonefish.write(MODEL)
    for speed in np.linspace(-top, top, 9):
        wanted = -(drag.k_q * abs(speed) + drag.k_l) * speed
        assert stonefish_force(exact, axis, speed, 2) == pytest.approx(wanted, abs=1e-4)
        # A cube cannot be a square: the comment in the file states the misfit, and it holds.
        assert (
            abs(stonefish_force(fitted, axis, speed, 3) - wanted)
            <= stonefish.coefficients(MODEL, axis, "cubic")[2] * (drag.k_q * top + drag.k_l) * top + 1e-6
        )
    assert stonefish.coefficients(MODEL, axis, "cubic")[2] < 0.10


def test_stonefish_coefficients_are_positive_or_it_would_ignore_them() -> None:
    body = ET.fromstring(stonefish.write(MODEL)).find("hydrodynamics")
    assert body is not None
    for name in ("viscous_drag", "quadratic_drag"):
        assert all(float(word) >= 0.0 for word in body.get(name, "").split())


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


@pytest.mark.parametrize("write", [gz.write, uuv.write, stonefish.write, vehicle_block.write, python_model.write])
def test_every_format_states_where_it_comes_from_and_what_its_signs_are(
    write: Callable[..., str] | Callable[[ExportModel], str],
) -> None:
    text = write(MODEL)
    assert "exported by hindrax from coefficients.yaml" in text
    assert "positive" in text
