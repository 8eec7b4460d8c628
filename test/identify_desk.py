"""Records of a known plant as others write them, and a desk at which `identify` is run over them."""

import functools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hindrax_cli.command_line import main
from hindrax_ident.arrays import Array
from hindrax_ident.model.motion_model import Model
from hindrax_ident.testing.synthetic_runs import Flight, back_and_forth, fly

MASS_kg = 20.0
TRUTH = {"k_q": 66.48, "k_l": 1.25, "added_mass": 12.0}
START_S = 1_700_000_000.0


@functools.cache
def flight(
    levels: tuple[float, ...] | tuple[float, float, float, float], end_s: float, span_s: float, k_q: float
) -> Flight:
    theta = np.array([k_q, TRUTH["k_l"], 0.0, MASS_kg + TRUTH["added_mass"]])
    return fly(Model(0, MASS_kg), theta, back_and_forth(levels, span_s, end_s), 0.0)


def flown(
    *,
    levels: tuple[float, ...] = (3.0, 6.0, 10.0, 14.0),
    noise: float = 0.01,
    gain: float = 1.0,
    current: float = 0.0,
    seed: int = 0,
    end_s: float = 80.0,
    span_s: float = 5.0,
    k_q: float = 66.48,
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Times and velocities at 10 Hz, times and forces at 25 Hz, of a vehicle that the model describes."""
    true = flight(levels, end_s, span_s, k_q)
    rng = np.random.default_rng(seed)
    t, v = true.grid.times_s[::20], true.path.v[::20]
    return (t, v + current + noise * rng.standard_normal(len(v))), (true.times_s[::2], gain * true.commands[::2])


def as_csv(
    path: Path, velocities: tuple[Array, Array], forces: tuple[Array, Array], names: tuple[str, str] = ("u", "X")
) -> Path:
    rows = [(t, f"{v:.6f}", "") for t, v in zip(*velocities, strict=True)]
    rows += [(t, "", f"{f:.6f}") for t, f in zip(*forces, strict=True)]
    lines = [f"{t:.4f},{a},{b}" for t, a, b in sorted(rows, key=lambda row: row[0])]
    path.write_text("\n".join([f"t,{names[0]},{names[1]}", *lines]))
    return path


class Desk:
    """Where records are identified: a folder for them, and the smallest vehicle file there is."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.folder, self.capsys = folder, capsys
        self.small = folder / "small.yaml"
        self.small.write_text(f"name: small\nmass_kg: {MASS_kg}\nvolume_m3: 0.0203\nenvelope_m: [0.6, 0.5, 0.4]\n")

    def csv(self, **record: Any) -> Path:
        return as_csv(self.folder / "a.csv", *flown(**record))

    def identified(self, *words: object) -> Any:
        assert main(["identify", *map(str, words), "--json"]) == 0
        return json.loads(self.capsys.readouterr().out)

    def of_small(self, *words: object) -> Any:
        return self.identified(*words, "--vehicle", self.small)

    def surge(self, *words: object) -> Any:
        return self.of_small(*words)["motions"]["surge"]

    def refused(self, *words: object, code: int = 2) -> str:
        assert main(["identify", *map(str, words)]) == code
        printed = self.capsys.readouterr().err.strip()
        assert printed.startswith("hindrax identify: ")
        assert "\n" not in printed
        return printed


@pytest.fixture
def desk(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Desk:
    return Desk(tmp_path, capsys)


def is_true(surge: dict[str, Any], sigmas: float = 4.0) -> bool:
    return all(abs(surge[name]["value"] - TRUTH[name]) < sigmas * surge[name]["std"] for name in TRUTH)


def force_at(surge: dict[str, Any], speed: float) -> float:
    found: float = surge["k_q"]["value"] * speed**2 + surge["k_l"]["value"] * speed
    return found


def reported(
    make: Callable[..., Any], topic: tuple[str, str, str], track: tuple[Array, Array], axis: int = 0, **more: float
) -> tuple[str, str, list[tuple[float, Any]]]:
    """A topic (type, name, frame) that tells values of one axis at their times."""
    kind, name, frame = topic
    rows = zip(*(column.tolist() for column in track), strict=True)
    return kind, name, [(t, make(kind, START_S + t, axis, value, frame, **more)) for t, value in rows]
