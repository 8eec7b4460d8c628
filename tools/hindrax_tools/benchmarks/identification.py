"""Identification of an hour at 20 Hz, all six axes, beside a black box that is fitted to the same record.

The record repeats one of a foreign plant, each time with noise of its own: 20 s on every axis in two minutes.
"""

from dataclasses import replace
from functools import partial
from importlib.metadata import version
from pathlib import Path

import numpy as np

from hindrax_analysis.identification.executor import Workers
from hindrax_analysis.identification.record_identification import IdentificationTask, RecordSource, identify_sources
from hindrax_analysis.records.recording import Recording
from hindrax_ident.arrays import Array, array
from hindrax_laboratory.benchmark.foreign_plants import (
    AS_THE_COMMAND,
    DOPPLER_mps,
    ForeignRecord,
    GYRO_radps,
    read,
    recorded,
)
from hindrax_laboratory.benchmark.rivals import black_box, by_axis
from hindrax_tools.benchmarks import interleaved_us, row

RECORD = Path(__file__).parents[2] / "test" / "foreign_records" / "middle-chirps-1.npz"
LASTS_s, REPEATS, STEP_s = 120.0, 30, 0.05
SEED = 1


def rows() -> list[dict[str, object]]:
    """One row: name, ours_us, peer, peer_us, ratio; one pass, as it takes a minute."""
    flown = read(RECORD)
    hour = replace(flown, recording=repeated(flown.recording, REPEATS))
    # With a process for each core, as the command has it; the peer knows of none.
    ours_us, peer_us = interleaved_us((partial(_identify, hour), partial(by_axis, hour, black_box)), 1)
    return [row("identify one hour, six axes", ours_us, f"sysidentpy {version('sysidentpy')} FROLS", peer_us)]


def _identify(record: ForeignRecord) -> None:
    source = RecordSource(Path(record.name), record.recording)
    task = IdentificationTask(tuning=AS_THE_COMMAND)
    identify_sources([source], record.vehicle, task, workers=Workers(processes=None))


def repeated(flown: Recording, repeats: int) -> Recording:
    """A record flown again and again, every velocity at 20 Hz.

    Parameters
    ----------
    flown
        Lasts LASTS_s.
    repeats
        How often.

    Returns
    -------
    Recording
        With fresh noise of Doppler log and gyroscopes.
    """
    t = array(np.arange(0.0, LASTS_s - STEP_s, STEP_s))
    known = [np.isfinite(one) for one in flown.velocity.T]
    pairs = zip(flown.velocity.T, known, strict=True)
    v = np.stack([np.interp(t, flown.velocity_t[has], one[has]) for one, has in pairs], axis=1)
    noise, rng = np.array([DOPPLER_mps] * 3 + [GYRO_radps] * 3), np.random.default_rng(SEED)
    noisy = [v + noise * rng.standard_normal(v.shape) for _ in range(repeats)]

    def again(times: Array) -> Array:
        """Times of all repeats [s]: (n,) to (repeats n,)."""
        return np.concatenate([times + LASTS_s * index for index in range(repeats)])

    return recorded(
        f"{flown.source}, {repeats} times",
        {
            "velocity_t": again(t),
            "velocity": np.concatenate(noisy),
            "wrench_t": again(flown.wrench_t),
            "wrench": np.tile(flown.wrench, (repeats, 1)),
            "attitude_t": again(flown.attitude_t),
            "attitude": np.tile(flown.attitude, (repeats, 1)),
        },
    )
