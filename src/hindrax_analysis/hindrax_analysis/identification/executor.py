"""Many runs: in this process, in processes of this machine, or on a running Dask cluster.

Results come in the order of the items; the exception of an item is raised in its place. Work and items must be
picklable: defined at the top of a module.
"""

import contextlib
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from typing import Any, TypeVar

from hindrax_core.errors import HindraxError

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")


def run_all(
    work: Callable[[ItemT], ResultT], items: Sequence[ItemT], *, cluster: str = "", workers: int | None = None
) -> Iterator[ResultT]:
    """On the cluster of an address, in this process for one worker, otherwise in processes (None: one per core)."""
    if cluster:
        return on_cluster(work, items, cluster)
    wanted = os.cpu_count() or 1 if workers is None else workers
    return map(work, items) if wanted == 1 else in_processes(work, items, wanted)


def in_processes(work: Callable[[ItemT], ResultT], items: Sequence[ItemT], workers: int) -> Iterator[ResultT]:
    """Processes of this machine, each with single-threaded linear algebra."""
    context, others = multiprocessing.get_context("spawn"), multiprocessing.active_children()
    with ProcessPoolExecutor(min(workers, max(1, len(items))), context, _begin) as pool:
        try:
            with _interrupts_deferred():
                futures = [pool.submit(work, item) for item in items]
            for future in futures:
                yield future.result()
        except BaseException:
            # Nobody wants the rest. The pool settles the futures itself: it trips over those that others cancel.
            for one in multiprocessing.active_children():
                if one not in others:
                    one.kill()
            raise


@contextlib.contextmanager
def _interrupts_deferred() -> Iterator[None]:
    """A Ctrl-C comes afterwards; processes that are started meanwhile get it when they have begun."""
    if sys.platform == "win32":  # there, no process inherits what is blocked
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _begin() -> None:
    # Workers use all cores already; threads of a linear algebra library would only compete for them.
    os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"
    # A terminal sends Ctrl-C to every process; the parent process ends the others.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform != "win32":
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def on_cluster(
    work: Callable[[ItemT], ResultT], items: Sequence[ItemT], address: str, timeout_s: float = 10.0
) -> Iterator[ResultT]:
    """A running Dask cluster, by the address of its scheduler; its workers need this software.

    HindraxError when there is no scheduler at the address or Dask is not installed.
    """
    try:
        from distributed import Client  # noqa: PLC0415  # heavy, and only wanted with --cluster
    except ImportError as error:
        raise HindraxError("--cluster needs the package `distributed`, which is not installed here") from error
    try:
        client: Any = Client(address, timeout=timeout_s)  # type: ignore[no-untyped-call]  # Dask has no annotations
    except (OSError, TimeoutError, ValueError) as error:
        raise HindraxError(
            f"no Dask scheduler answers at {address} ({error}); start one or leave --cluster out"
        ) from error
    futures = client.map(work, list(items), pure=False)
    try:
        for future in futures:
            yield future.result()
    finally:
        client.cancel(futures)
        client.close()
