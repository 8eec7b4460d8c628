"""Executors for many runs: processes of this machine, or a running Dask cluster.

Each has `map`, with results in the order of the items; the exception of an item is raised in its place. Function and
items must be picklable: defined at the top of a module.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from typing import Any, TypeVar

from hindrax_core.errors import HindraxError

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")


class InThisProcess:
    """Sequential execution."""

    def map(self, work: Callable[[ItemT], ResultT], items: Sequence[ItemT]) -> Iterator[ResultT]:
        """Compute each item when its result is requested."""
        return map(work, items)


class LocalProcesses:
    """Processes of this machine, each with single-threaded linear algebra."""

    def __init__(self, workers: int = 0) -> None:
        """`workers`: 0 for one per core."""
        self.workers = workers or os.cpu_count() or 1

    def map(self, work: Callable[[ItemT], ResultT], items: Sequence[ItemT]) -> Iterator[ResultT]:
        """Compute all items in a pool of workers."""
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(min(self.workers, max(1, len(items))), context, _begin) as pool:
            with _interrupts_deferred():
                futures = [pool.submit(work, item) for item in items]
            yield from _in_order(futures)


def _in_order(futures: Sequence[Future[ResultT]]) -> Iterator[ResultT]:
    try:
        for future in futures:
            yield future.result()
    finally:
        for future in futures:
            future.cancel()


@contextlib.contextmanager
def _interrupts_deferred() -> Iterator[None]:
    """A Ctrl-C comes afterwards; processes that are started meanwhile get it when they have begun."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin() -> None:
    # Workers use all cores already; threads of a linear algebra library would only compete for them.
    os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"
    # A terminal sends Ctrl-C to every process; only the one that was started by hand has something to say about it.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


class DaskCluster:
    """A running Dask cluster, by the address of its scheduler; its workers need this software."""

    def __init__(self, address: str, timeout_s: float = 10.0) -> None:
        """HindraxError when there is no scheduler at the address or Dask is not installed."""
        try:
            from distributed import Client  # noqa: PLC0415  # heavy, and only wanted with --cluster
        except ImportError as error:
            raise HindraxError("--cluster needs the package `distributed`, which is not installed here") from error
        try:
            self._client: Any = Client(address, timeout=timeout_s)  # type: ignore[no-untyped-call]  # Dask has no annotations
        except (OSError, TimeoutError, ValueError) as error:
            raise HindraxError(
                f"no Dask scheduler answers at {address} ({error}); start one or leave --cluster out"
            ) from error

    def map(self, work: Callable[[ItemT], ResultT], items: Sequence[ItemT]) -> Iterator[ResultT]:
        """Compute all on the cluster."""
        futures = self._client.map(work, list(items), pure=False)
        try:
            for future in futures:
                yield future.result()
        finally:
            self._client.cancel(futures)
            self._client.close()


def executor_for(cluster: str = "", workers: int = 0) -> InThisProcess | LocalProcesses | DaskCluster:
    """Cluster for an address, this process for one worker, otherwise processes."""
    if cluster:
        return DaskCluster(cluster)
    return InThisProcess() if workers == 1 else LocalProcesses(workers)
