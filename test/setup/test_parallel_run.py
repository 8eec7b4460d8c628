"""Which worker of a parallel run gets which file."""

from types import SimpleNamespace
from typing import Any

import pytest
from parallel_run import FileScheduling

WAIT = [f"test/ros/test_{name}.py::test_it" for name in "abcd"]
COMPUTE = [f"src/hindrax_ident/test/test_{name}.py::test_it" for name in "ab"]


class Worker:
    """Takes tests, as the proxy of a worker process does."""

    shutting_down = False
    gateway = SimpleNamespace(id="any")

    def __init__(self, collection: list[str]) -> None:
        self.collection = collection
        self.files: list[str] = []

    def send_runtest_some(self, indices: list[int]) -> None:
        self.files += [self.collection[index].partition("::")[0] for index in indices]

    def shutdown(self) -> None:
        self.shutting_down = True


def begun(config: pytest.Config, workers: int) -> tuple[Any, list[Worker]]:
    """A run whose workers have what they begin with."""
    collection = [*WAIT, *COMPUTE]
    config.option.tx = ["popen"] * workers
    scheduling, made = FileScheduling(config), [Worker(collection) for _ in range(workers)]
    for worker in made:
        scheduling.add_node(worker)
        scheduling.add_node_collection(worker, collection)
    scheduling.schedule()
    return scheduling, made


@pytest.fixture
def config(pytestconfig: pytest.Config, monkeypatch: pytest.MonkeyPatch) -> pytest.Config:
    for name in ("tx", "loadscopereorder"):
        monkeypatch.setattr(pytestconfig.option, name, getattr(pytestconfig.option, name, None), raising=False)
    return pytestconfig


def test_some_compute_while_others_wait_and_all_is_run_once(config: pytest.Config) -> None:
    scheduling, workers = begun(config, 3)
    for worker in workers:
        while not worker.shutting_down:
            scheduling.mark_test_complete(worker, worker.collection.index(f"{worker.files[-1]}::test_it"))
    first = [worker.files[0] for worker in workers]
    assert [file.startswith("test/ros/") for file in first] == [True, True, False]
    done = [f"{file}::test_it" for worker in workers for file in worker.files]
    assert sorted(done) == sorted([*WAIT, *COMPUTE])


def test_one_worker_takes_them_as_they_were_collected(config: pytest.Config) -> None:
    scheduling, (worker,) = begun(config, 1)
    while not worker.shutting_down:
        scheduling.mark_test_complete(worker, worker.collection.index(f"{worker.files[-1]}::test_it"))
    assert [f"{file}::test_it" for file in worker.files] == [*WAIT, *COMPUTE]


def test_the_test_with_which_a_worker_ended_is_not_given_to_another(config: pytest.Config) -> None:
    scheduling, (first, second) = begun(config, 2)
    of_the_dead = first.files[0]
    assert scheduling.remove_node(first) == f"{of_the_dead}::test_it"
    while not second.shutting_down:
        scheduling.mark_test_complete(second, second.collection.index(f"{second.files[-1]}::test_it"))
    assert of_the_dead not in second.files
    assert set(second.files) >= {test.partition("::")[0] for test in (*WAIT, *COMPUTE)} - set(first.files)
