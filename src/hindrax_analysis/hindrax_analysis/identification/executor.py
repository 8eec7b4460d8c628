"""Many runs: in this process, in processes of this machine, or on a running Dask cluster.

Results come in the order of the items; the exception of an item is raised in its place. Work and items must be
picklable: defined at the top of a module.
"""

import argparse
import contextlib
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from operator import call
from typing import Any, TypeVar

from hindrax_core.errors import HindraxError
from hindrax_core.text.screen_text import how_to_install

CLOSES_ITSELF = (3, 11, 5)
"""First Python whose pool lets go of what no process reads any more."""
ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")


@dataclass(frozen=True, slots=True)
class Workers:
    """Where jobs run: on the cluster of an address, else in processes of this machine (None: one per core)."""

    cluster: str = ""
    processes: int | None = 1

    @property
    def here(self) -> bool:
        """Whether jobs run in this process, one after the other: only then may they tell of their progress."""
        return not self.cluster and self.processes == 1

    def run(self, jobs: Sequence[Callable[[], ResultT]]) -> Iterator[ResultT]:
        """Results in the order of the jobs, each as soon as it is there."""
        # One type of job for the checker, which takes `call` for a function of any arguments.
        work: Callable[[Callable[[], ResultT]], ResultT] = call
        return run_all(work, jobs, cluster=self.cluster, workers=self.processes)


HERE = Workers()
"""This process."""


def add_workers(parser: argparse.ArgumentParser, processes: int | None = 1, usual: str = "") -> None:
    """Add the options for `workers_of`.

    Parameters
    ----------
    parser
        Of a command.
    processes
        Local ones where neither option is given; None: one per core.
    usual
        Words for that in the help.

    Raises
    ------
    argparse.ArgumentTypeError
        When the command line is parsed, for less than one process.
    """

    def count(text: str) -> int:
        """Argument type: one process or more."""
        if (number := int(text)) < 1:
            raise argparse.ArgumentTypeError(f"found {text}, wanted 1 or more")
        return number

    usual = usual or ("one per core" if processes is None else f"{processes}")
    parser.add_argument("--cluster", default="", metavar="ADDRESS", help="compute on this Dask cluster")
    parser.add_argument(
        "--workers", type=count, default=processes, metavar="N", help=f"local processes; default: {usual}"
    )


def workers_of(arguments: argparse.Namespace) -> Workers:
    """Where the jobs of a command run, by its options."""
    return Workers(arguments.cluster, arguments.workers)


def run_all(
    work: Callable[[ItemT], ResultT], items: Sequence[ItemT], *, cluster: str = "", workers: int | None = None
) -> Iterator[ResultT]:
    """Do work over items, somewhere.

    Parameters
    ----------
    work, items
        A function that another process can import, and its arguments.
    cluster
        Address of a Dask scheduler; empty: this machine.
    workers
        Local processes; 1: this one; None: one per core.

    Returns
    -------
    Iterator[ResultT]
        In the order of the items.
    """
    if cluster:
        return on_cluster(work, items, cluster)
    wanted = os.cpu_count() or 1 if workers is None else workers
    return map(work, items) if wanted == 1 else in_processes(work, items, wanted)


def in_processes(work: Callable[[ItemT], ResultT], items: Sequence[ItemT], workers: int) -> Iterator[ResultT]:
    """Do work in processes of this machine, each with single-threaded linear algebra.

    Parameters
    ----------
    work, items
        A function that another process can import, and its arguments.
    workers
        Processes at most.

    Yields
    ------
    ResultT
        In the order of the items. Whatever ends the iteration early ends the processes.

    Raises
    ------
    HindraxError
        Where one of the processes was killed from outside.
    """
    context, others = multiprocessing.get_context("spawn"), multiprocessing.active_children()
    with ProcessPoolExecutor(min(workers, max(1, len(items))), context, _begin) as pool:
        try:
            with _interrupts_deferred():
                futures = [pool.submit(work, item) for item in items]
            for future in futures:
                yield future.result()
        except BrokenProcessPool as error:
            _unblock(pool)
            raise HindraxError(
                "a process that computed was killed, as by a machine without free memory; free some, or take "
                "`--workers 1`, which needs the least"
            ) from error
        except BaseException:
            # Nobody wants the rest. The pool settles the futures itself: it trips over those that others cancel.
            for one in multiprocessing.active_children():
                if one not in others:
                    one.kill()
            _unblock(pool)
            raise


def _unblock(pool: ProcessPoolExecutor) -> None:
    """Let go of an item that no process reads any more: larger than a pipe, it would hold the pool at its end.

    Python does so itself from 3.11.5 on (its issue 94777), but not yet the 3.11.2 of Debian 12; to close it twice would
    close what another thread has opened meanwhile.
    """
    if sys.version_info < CLOSES_ITSELF and (queue := getattr(pool, "_call_queue", None)) is not None:
        queue._reader.close()  # noqa: SLF001  # nothing public ends the wait


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
    """Do work on a running Dask cluster.

    Parameters
    ----------
    work, items
        A function that the workers can import, and its arguments.
    address
        Of the scheduler.
    timeout_s : [s]
        For its answer.

    Yields
    ------
    ResultT
        In the order of the items.

    Raises
    ------
    HindraxError
        When there is no scheduler at the address, when this software is missing there, or Dask here.
    """
    try:
        from distributed import Client  # noqa: PLC0415  # heavy, and only wanted with --cluster
    except ImportError as error:
        raise HindraxError(
            f"--cluster needs the package `distributed`, which is not installed here; {how_to_install('cluster')}"
        ) from error
    try:
        client: Any = Client(address, timeout=timeout_s)  # type: ignore[no-untyped-call]  # Dask has no annotations
    except (OSError, TimeoutError, ValueError) as error:
        raise HindraxError(
            f"no Dask scheduler answers at {address} ({error}); start one or leave --cluster out"
        ) from error
    futures = client.map(work, list(items), pure=False)
    try:
        for future in futures:
            with _software_wanted(address):
                found = future.result()
            yield found
    finally:
        client.cancel(futures)
        client.close()


@contextlib.contextmanager
def _software_wanted(address: str) -> Iterator[None]:
    """Instead of the traceback of a task that scheduler or worker cannot read: what is missing there."""
    try:
        yield
    except (ImportError, RuntimeError) as error:
        missing = _missing(error)
        if missing is None:
            raise
        raise HindraxError(
            f"the Dask cluster at {address} lacks the module {missing!r}; install `hindrax[cluster]` of the same "
            "version where its scheduler and its workers run"
        ) from error


def _missing(error: BaseException | None) -> str | None:
    """Name of a module that a chain of exceptions says is not installed."""
    while error is not None:
        if isinstance(error, ImportError) and error.name:
            return error.name
        error = error.__cause__ or error.__context__
    return None
