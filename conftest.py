"""What every test run has in common."""

import faulthandler
import gc
import os
import signal
from collections.abc import Generator, Iterator
from pathlib import Path

import pytest
from parallel_run import FileProgress, FileScheduling, long_ones_first
from xdist.scheduler import Scheduling

from hindrax_bringup.network.tether import loopback_profile
from hindrax_bringup.ros_graph import OUR_RMW, PROFILE, RANGE, RMW, graph_settings
from hindrax_bringup.stack_lock import FOLDER
from hindrax_core.testing import load_profile
from hindrax_core.vehicle import Vehicle, load_vehicle
from hindrax_ros.testing.fixtures import ros_domain

__all__ = ["ros_domain"]
"""A fixture of all tests."""

load_profile()
gc.disable()  # of a collection of the tests a fifth is looking for garbage, among what is imported to stay

# The graph of a shell does not decide: what it has set for other robots is not there when the client library is loaded.
# Nor does its way of writing: without buffers, what a buffer leaves behind at the end of a process was never seen.
# Tests join over datagrams, as the stack does: they kill processes, and whoever held a lock in shared memory keeps it.
for name in (*graph_settings(os.environ), "PYTHONUNBUFFERED"):
    os.environ.pop(name, None)
os.environ |= {RMW: OUR_RMW, RANGE: "SYSTEM_DEFAULT", PROFILE: str(loopback_profile())}

LONGEST_S = 900.0
"""Of one test with its fixtures, ten times what the longest takes on two cores: what takes longer hangs."""
LONGEST_ID, LONGEST_BEGIN = 120, 24
"""Letters of one value in the identifier of a test, and of what stands for a longer one."""

# A shell ignores Ctrl-C for what it runs in the background, and all that the tests start would.
signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def vehicle() -> Vehicle:
    """The Hindrax itself."""
    return load_vehicle(Path(__file__).parent / "src/hindrax_bringup/vehicles/hindrax.yaml")


class HangGuard:
    """Ends a worker whose test hangs, in a library too, with the traceback of each thread; the others go on."""

    def __init__(self) -> None:
        self._stderr = os.dup(2)  # that of a test is captured

    @pytest.hookimpl(hookwrapper=True)
    def pytest_runtest_protocol(self) -> Generator[None, None, None]:
        """Count anew for each test."""
        faulthandler.dump_traceback_later(LONGEST_S, exit=True, file=self._stderr)
        yield
        faulthandler.cancel_dump_traceback_later()


def pytest_configure(config: pytest.Config) -> None:
    """Show the files of a parallel run as they are done."""
    if hasattr(config, "workerinput"):
        config.pluginmanager.register(HangGuard(), "hang-guard")
    if config.getoption("numprocesses"):
        gc.enable()  # who gives out the tests collects none
    if config.getoption("numprocesses") and config.option.verbose < 0:
        config.pluginmanager.register(FileProgress(config), "file-progress")


def pytest_make_parametrize_id(val: object) -> str | None:
    """Name a long text or many bytes by their beginning and length: an identifier is for people."""
    if not isinstance(val, str | bytes) or len(ascii(val)) <= LONGEST_ID:
        return None
    begin = val[:LONGEST_BEGIN] if isinstance(val, str) else val[:LONGEST_BEGIN].decode("latin-1")
    return f"{begin}... {len(val)} long"


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Begin a parallel run with what takes long, so that no worker is left alone with it at the end."""
    if hasattr(config, "workerinput"):
        long_ones_first(items)


def pytest_collection_finish() -> None:
    """Keep what was collected out of garbage collection: half a million objects, looked at again and again (0.3 s)."""
    gc.freeze()
    gc.enable()


def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> Scheduling | None:
    """Keep the tests of one file, and files that share a flight, on one worker; another --dist is left as it is."""
    return FileScheduling(config, log) if config.option.dist == "load" else None


@pytest.fixture(scope="session", autouse=True)
def runtime_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Stacks of the tests are announced apart: neither other workers nor whoever works on this machine meets them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(FOLDER, str(tmp_path_factory.mktemp("runtime")))
        yield
