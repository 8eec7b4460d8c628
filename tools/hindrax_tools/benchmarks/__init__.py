"""Speed, each figure beside a peer measured in the same run: every module offers `rows() -> list[dict]`."""

import statistics
import time
import timeit
from collections.abc import Callable, Iterable

import psutil


def row(name: str, ours_us: float, peer: str, peer_us: float) -> dict[str, object]:
    """Row of a figure and its peer."""
    return {"name": name, "ours_us": ours_us, "peer": peer, "peer_us": peer_us, "ratio": peer_us / ours_us}


def median_us(call: Callable[[], object], number: int, repeats: int) -> float:
    """Median over repeats of the time of one call [us]."""
    return statistics.median(timeit.repeat(call, number=number, repeat=repeats)) / number * 1e6


def interleaved_us(
    calls: tuple[Callable[[], object], ...], passes: int, clock: Callable[[], float] = time.perf_counter
) -> list[float]:
    """Median times of calls that take turns [us], so that all share the machine's good and bad moments."""

    def timed_us(call: Callable[[], object]) -> float:
        begin = clock()
        call()
        return (clock() - begin) * 1e6

    passed = [[timed_us(call) for call in calls] for _ in range(passes)]
    return [statistics.median(one) for one in zip(*passed, strict=True)]


def family(pid: int) -> list[psutil.Process]:
    """A process and those below it."""
    process = psutil.Process(pid)
    return [process, *process.children(recursive=True)]


def cpu_s(processes: Iterable[psutil.Process]) -> float:
    """CPU time of some processes, in user and system mode [s]."""
    return float(sum(sum(one.cpu_times()[:2]) for one in processes))
