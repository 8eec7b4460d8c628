"""Work on a Dask cluster: the numbers of this machine, and one sentence where the cluster cannot do it."""

import importlib
import json
import math
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from hindrax_analysis.identification.executor import Workers, on_cluster, run_all
from hindrax_cli.command_line import main
from hindrax_core.errors import HindraxError
from hindrax_laboratory.benchmark.blind_benchmark import answers
from hindrax_tools import fault_fuzzer

distributed = pytest.importorskip("distributed")
STEP_S, SPAN_S = 0.2, 21.0
VEHICLE = "name: small\nmass_kg: 20.0\nvolume_m3: 0.02\nenvelope_m: [0.5, 0.4, 0.3]\n"
RECORD = Path(__file__).parents[2] / "tools/test/foreign_records/small-steps-1.npz"


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """Address of a scheduler whose only worker is a thread of this process."""
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None, protocol="tcp", host="127.0.0.1"
    ) as here:
        yield here.scheduler_address


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Two records of surge, pushed forth and back, and the vehicle's file."""
    folder = tmp_path_factory.mktemp("records")
    (folder / "small.yaml").write_text(VEHICLE, encoding="utf-8")
    files = [folder / f"{seed}.csv" for seed in (1, 2)]
    for seed, file in enumerate(files):
        file.write_text(surge(seed), encoding="utf-8")
    return [*map(str, files), "--vehicle", str(folder / "small.yaml"), "--dof", "surge"]


def surge(seed: int) -> str:
    """A record of forces and speeds, seen with some noise."""
    noise = np.random.default_rng(seed).normal(0.0, 0.005, round(SPAN_S / STEP_S)).tolist()
    lines, u = ["t,u,X"], 0.0
    for index, error in enumerate(noise):
        t = STEP_S * index
        X = (20.0 if t % 20.0 < 10.0 else 8.0) * (1.0 if t % 10.0 < 5.0 else -1.0)
        lines.append(f"{t:.2f},{u + error:.4f},{X}")
        for _ in range(10):
            u += 0.1 * STEP_S * (X - 60.0 * abs(u) * u) / 32.0
    return "\n".join(lines)


@pytest.fixture
def printed(capsys: pytest.CaptureFixture[str]) -> Callable[[list[str]], dict[str, object]]:
    """The document that a command prints, without what the clock decides."""

    def run(words: list[str]) -> dict[str, object]:
        """Words of the command line."""
        assert main([*words, "--json"]) == 0
        document: dict[str, object] = json.loads(capsys.readouterr().out)
        document.pop("real_time_factor", None)
        return document

    return run


def test_work_is_done_there_and_comes_in_order(cluster: str) -> None:
    assert list(run_all(lambda _: distributed.get_worker() is not None, [0], cluster=cluster)) == [True]
    assert list(run_all(math.factorial, range(5), cluster=cluster)) == [1, 1, 2, 6, 24]


def test_records_are_identified_and_predicted_as_here(
    cluster: str, records: list[str], printed: Callable[[list[str]], dict[str, object]], tmp_path: Path
) -> None:
    file = str(tmp_path / "coefficients.yaml")
    here = printed(["identify", *records, "--coefficients", file])
    there = printed(["identify", *records, "--cluster", cluster])
    assert there == here
    assert len(here["runs"]) == 2  # type: ignore[arg-type]
    predicted = printed(["predict", file, *records])
    assert printed(["predict", file, *records, "--cluster", cluster]) == predicted
    assert predicted["motions"]["surge"]["windows"] == 4  # type: ignore[index]


def test_the_benchmark_is_answered_as_here(cluster: str, tmp_path: Path) -> None:
    (tmp_path / RECORD.name).write_bytes(RECORD.read_bytes())
    told: list[str] = []
    here = answers(tmp_path, "least-squares", reached=told.append)
    assert list(here) == [RECORD.stem]
    assert told == ["1 of 1"]
    assert answers(tmp_path, "least-squares", Workers(cluster)) == here


def test_the_fuzzer_flies_the_same_cases(cluster: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fault_fuzzer, "ROUND", 3)
    monkeypatch.setattr(fault_fuzzer, "violations", str)
    here = list(islice(fault_fuzzer.fuzzed(1.0, 5), 7))
    assert list(islice(fault_fuzzer.fuzzed(1.0, 5, Workers(cluster)), 7)) == here


class Elsewhere:
    """Work that a worker without the software cannot read."""

    def __reduce__(self) -> tuple[Callable[[str], object], tuple[str]]:
        return importlib.import_module, ("hindrax_elsewhere",)


def test_a_cluster_without_the_software_is_one_sentence(cluster: str) -> None:
    with pytest.raises(HindraxError, match=r"lacks the module 'hindrax_elsewhere'; install `hindrax\[cluster\]`"):
        list(on_cluster(str, [Elsewhere()], cluster))


def test_what_goes_wrong_there_is_raised_here(cluster: str) -> None:
    with pytest.raises(ValueError, match="negative"):
        list(on_cluster(math.factorial, [-1], cluster))


def test_no_cluster_at_the_address_is_reported() -> None:
    with pytest.raises(HindraxError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:1"):
        list(on_cluster(math.factorial, [1], "tcp://127.0.0.1:1", timeout_s=0.2))
