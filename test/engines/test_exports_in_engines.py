"""Exported vehicles in the engines that they are for, beside the plant of the mock: same steps, same motion."""

import importlib.util
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pytest
from gz_on_dart import GzModel

from hindrax_analysis.exports import gz, mujoco, python_model
from hindrax_analysis.exports.export_model import ExportModel
from hindrax_core.readings import Vec6
from hindrax_core.vehicle import AXES, Vehicle, load_vehicle
from hindrax_ident.arrays import Array, array
from hindrax_sim.physics.plant import Plant

VEHICLES = Path(__file__).parents[2] / "src/hindrax_bringup/vehicles"
NAMES = ("hindrax", "bluerov2", "bluerov2-heavy", "lbv")
DT_S, SECONDS = 0.004, 3.0
HALF_TURN = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0])
UP = (0.0, 0.0, -1.0, 0.0, 0.0, 0.0)
COUPLED = ((0.6, 0.4, 0.0, 0.0, 0.0, 0.5), (0.5, 0.0, 0.5, 0.0, 0.3, 0.0), (0.4, 0.4, -0.4, 0.3, 0.3, 0.4))
"""Wrenches as parts of those that hold the largest speed of each axis."""
STEADY = {"bluerov2-heavy": 0.25}
"""Part of the thrust up to which a vehicle runs straight: beyond, the Munk moment beats its righting moment, and the
smallest difference between two engines grows until it turns."""


class Engine(Protocol):
    """A vehicle somewhere: wrench about the center of mass in, velocity of the center of mass out, both SNAME."""

    def step(self, wrench: Array) -> None: ...

    @property
    def velocity(self) -> Array: ...


class InGz:
    def __init__(self, model: ExportModel, _folder: Path) -> None:
        self._inner = GzModel(gz.write(model), DT_S, model.vehicle.water.density_kgpm3)

    def step(self, wrench: Array) -> None:
        self._inner.step(array(HALF_TURN * np.array(wrench)))

    @property
    def velocity(self) -> Array:
        return array(HALF_TURN * self._inner.velocity)


class InMujoco:
    def __init__(self, model: ExportModel, folder: Path) -> None:
        for name, text in mujoco.folder(model).items():
            (folder / name).write_text(text)
        self._inner = loaded(folder / "mujoco_vehicle.py").UnderwaterVehicle.from_folder(folder)
        self._inner.model.opt.timestep = DT_S

    def step(self, wrench: Array) -> None:
        self._inner.step(np.array(wrench))

    @property
    def velocity(self) -> Array:
        return array(self._inner.velocity)


class InPython:
    def __init__(self, model: ExportModel, folder: Path) -> None:
        (folder / "model.py").write_text(python_model.write(model))
        self._module = loaded(folder / "model.py")
        self.velocity, self._attitude = np.zeros(6), np.zeros(3)

    def step(self, wrench: Array) -> None:
        self.velocity, self._attitude = self._module.step(self.velocity, self._attitude, wrench, DT_S)


def loaded(file: Path) -> Any:
    spec = importlib.util.spec_from_file_location(file.stem, file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def named(name: str) -> Vehicle:
    return load_vehicle(VEHICLES / f"{name}.yaml")


def model_of(vehicle: Vehicle) -> ExportModel:
    assert vehicle.hydrodynamics is not None
    speed = vehicle.limits.speed_mps
    return ExportModel(vehicle, vehicle.hydrodynamics, (speed, speed, speed, 1.0, 1.0, 1.0), "the vehicle file")


def holding(model: ExportModel) -> Array:
    """Wrench that holds the largest tested speed, axis by axis."""
    return array([model.hydrodynamics.drag(a).resistance(top) for a, top in zip(AXES, model.top_speed, strict=True)])


def flown(step: Callable[[Array], None], velocity: Callable[[], Array], wrench: Array) -> Array:
    """Velocities (n, 6) after a step of the wrench, from rest."""
    rows = []
    for _ in range(int(SECONDS / DT_S)):
        step(wrench)
        rows.append(velocity())
    return np.array(rows)


def of_plant(model: ExportModel, wrench: Array) -> Array:
    force: Vec6 = tuple(float(value) for value in wrench)  # type: ignore[assignment]  # six of them
    plant = Plant(model.vehicle, (lambda _plant, _dt: force,))
    plant.place((0.0, 0.0, 50.0), (0.0, 0.0, 0.0))
    return flown(
        lambda _wrench: plant.step(DT_S),
        lambda: array([plant.u, plant.v, plant.w, plant.p, plant.q, plant.r]),
        wrench,
    )


def rise_s(speed: Array) -> float:
    """Time until a motion has gathered 63 % of its last speed [s], between samples."""
    return float(np.interp(0.632 * abs(speed[-1]), np.abs(speed), DT_S * np.arange(1, len(speed) + 1)))


@pytest.mark.parametrize("engine", [InGz, InMujoco, InPython])
@pytest.mark.parametrize("name", NAMES)
def test_steps_of_six_axes_and_coupled_ones_are_those_of_the_plant(
    name: str, engine: Callable[[ExportModel, Path], Engine], tmp_path: Path
) -> None:
    model = model_of(named(name))
    hold, level = STEADY.get(name, 1.0) * holding(model), np.zeros(6)
    terminal = slack(model, engine)
    level[2] = model.vehicle.buoyancy_N - model.vehicle.weight_N
    for index, parts in enumerate((*np.eye(6), UP, *COUPLED)):
        # What tips a small vehicle over is no step but a capsize.
        wrench = np.array(parts) * hold * np.array([1.0, 1.0, 1.0, 0.3, 0.3, 1.0]) + level
        vehicle = engine(model, tmp_path)
        found, wanted = (
            flown(vehicle.step, partial(getattr, vehicle, "velocity"), array(wrench)),
            of_plant(model, array(wrench)),
        )
        about = f"{name}, step {index}"
        size = np.maximum(np.abs(wanted).max(axis=0), 0.1 * np.array(model.top_speed))
        # On the way two integrators differ by a part of a step; three of them carry on what the drag lacks.
        assert np.abs(found - wanted).max(axis=0) / size == pytest.approx(np.zeros(6), abs=0.01 + 3.0 * terminal), about
        if sum(map(bool, parts)) == 1 and index not in (3, 4):  # those swing about where weight rights them
            axis = int(np.argmax(np.abs(parts)))
            assert found[-1, axis] == pytest.approx(wanted[-1, axis], rel=terminal), about
            assert rise_s(found[:, axis]) == pytest.approx(
                rise_s(wanted[:, axis]), rel=max(0.02, terminal), abs=0.5 * DT_S
            ), about


def test_in_mujoco_a_push_from_outside_moves_the_wet_vehicle_as_a_wrench_does(tmp_path: Path) -> None:
    model = model_of(named("hindrax"))
    wrench = array(0.3 * np.array([1.0, 0.5, -0.5, 0.1, 0.1, 0.5]) * holding(model))
    wanted, vehicle = InMujoco(model, tmp_path), InMujoco(model, tmp_path)
    inner = vehicle._inner
    body = inner.model.body("base_link").id

    def pushed(_wrench: Array) -> None:
        turn = inner.data.xmat[body].reshape(3, 3)
        inner.data.xfrc_applied[body] = (*turn @ (HALF_TURN * wrench)[:3], *turn @ (HALF_TURN * wrench)[3:])
        vehicle.step(np.zeros(6))

    found = flown(pushed, lambda: vehicle.velocity, wrench)
    same = flown(wanted.step, lambda: wanted.velocity, wrench)
    # The push has the attitude of a step before.
    assert np.abs(found - same).max(axis=0) / np.array(model.top_speed) == pytest.approx(np.zeros(6), abs=0.01)


def slack(model: ExportModel, engine: Callable[[ExportModel, Path], Engine]) -> float:
    """One hundredth, or what the file itself says about a drag that its format cannot hold."""
    two_sided = any(model.hydrodynamics.drag(axis).k_l_negative is not None for axis in AXES)
    return 0.042 if engine is InGz and two_sided else 0.01
