"""The suite on all cores: whole files go to the workers, the longest first, and each is shown when it is done.

Tests with real processes wait for half of their time, and all others compute. While some workers wait, others compute:
each kind has workers that take it first, so that no core is idle.
"""

import time
from collections import Counter, defaultdict
from collections.abc import Generator, Sequence
from typing import Any

import pluggy
import pytest
from xdist.scheduler import LoadScopeScheduling

ONE_FLIGHT = ("test/ros/test_pool_test.py", "test/ros/test_tutorial.py")
"""Files that look at the same pool test, which one worker flies once."""
REAL_PROCESSES = ("test/ros/", "test/faults/", "test/deployment/")
"""Folders of the tests that wait."""
COMPUTING = 3
"""Every third worker takes what computes first."""


def file_of(nodeid: str) -> str:
    """Return the file of a test; the files of one flight count as one."""
    file = nodeid.partition("::")[0]
    return ONE_FLIGHT[0] if file in ONE_FLIGHT else file


def long_ones_first(items: list[pytest.Item]) -> None:
    """Sort by file: real processes and other long work, then what tests several packages, then the packages."""
    long = {file_of(item.nodeid) for item in items if any(map(item.get_closest_marker, ("ros", "long")))}
    items.sort(key=lambda item: (file_of(item.nodeid) not in long, not item.nodeid.startswith("test/")))


class FileScheduling(LoadScopeScheduling):  # type: ignore[misc]  # xdist has no public base
    """Gives whole files to the workers, in the order in which they were collected, the kind of each worker first."""

    def __init__(self, config: pytest.Config, log: Any = None) -> None:
        config.option.loadscopereorder = False
        super().__init__(config, log)

    def _split_scope(self, nodeid: str) -> str:
        return file_of(nodeid)

    def _assign_work_unit(self, node: Any) -> None:
        computes = self.nodes.index(node) % COMPUTING == COMPUTING - 1
        wanted = (file for file in self.workqueue if file.startswith(REAL_PROCESSES) != computes)
        if file := next(wanted, ""):
            self.workqueue.move_to_end(file, last=False)
        super()._assign_work_unit(node)

    def remove_node(self, node: Any) -> str | None:
        """Fail the test with which a worker ended, and give out the rest of its file; xdist would give it out again."""
        units = self.assigned_work.get(node, {}).values()
        crashed = next((test for unit in units for test, done in unit.items() if not done), None)
        for unit in units:
            if crashed in unit:
                unit[crashed] = True
        super().remove_node(node)
        return crashed


class FileProgress:
    """One line per file of a parallel run: share of all tests, time since the beginning, file, outcome, seconds."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config
        self._left: Counter[str] = Counter()
        self._total = 0
        self._begin = time.monotonic()
        self._outcomes: dict[str, Counter[str]] = {}
        self._seconds: defaultdict[str, float] = defaultdict(float)

    def pytest_xdist_node_collection_finished(self, ids: Sequence[str]) -> None:
        """Learn what there is; every worker has collected the same."""
        if not self._total:
            self._left, self._total = Counter(map(file_of, ids)), len(ids)

    @pytest.hookimpl(hookwrapper=True)
    def pytest_report_teststatus(self) -> Generator[None, pluggy.Result[tuple[str, str, str]], None]:
        """Count as ever, without the dot."""
        status = yield
        category, _, word = status.get_result()
        status.force_result((category, "", word))

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Count; show a test that failed, and a file whose last test is done."""
        file = file_of(report.nodeid)
        if report.failed:
            self._write(f"FAILED {report.nodeid}")
        outcomes = self._outcomes.setdefault(file, Counter())
        self._seconds[file] += report.duration
        if report.when == "call" or not report.passed:
            outcomes[report.outcome] += 1
        if report.when == "teardown":
            self._left[file] -= 1
            if not self._left[file]:
                self._show(file)

    def _show(self, file: str) -> None:
        left = sum(self._left.values())
        minutes, seconds = divmod(round(time.monotonic() - self._begin), 60)
        outcome = ", ".join(f"{count} {what}" for what, count in self._outcomes[file].items())
        line = f"{100 * (self._total - left) // self._total:3d}% {minutes:2d}:{seconds:02d}  {file}: {outcome}"
        self._write(f"{line} ({self._seconds[file]:.0f} s)")

    def _write(self, line: str) -> None:
        terminal = self._config.pluginmanager.getplugin("terminalreporter")
        terminal.ensure_newline()
        terminal.write_line(line)
        terminal.flush()
