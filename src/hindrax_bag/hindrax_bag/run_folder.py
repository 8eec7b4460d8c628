"""The folder of one run: bag, logs, parameters, vehicle file, coefficients, report."""

import contextlib
import itertools
import shutil
from collections.abc import Collection, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path

import yaml

from hindrax_core.errors import HindraxError, UsageError, cause
from hindrax_core.text.text_file import nothing_left, writing

FREE_BYTES_WANTED = 500_000_000
FIRST_YEAR = 2025
"""A clock before it was never set: a Raspberry Pi has no battery clock."""
RUNS = Path("runs")
"""Folder of runs that are named by their time."""


class RunFolder:
    """Paths of one run: folders of the bag and of the output of each process, and what else belongs to it."""

    def __init__(self, path: Path, made: Sequence[Path] = ()) -> None:
        self.path = path
        self._made = made
        self.bag, self.logs = path / "bag", path / "logs"
        self.vehicle = path / "vehicle.yaml"
        """Copy of the vehicle file in force."""
        self.parameters = path / "parameters.yaml"
        """ROS parameters of every node."""
        self.coefficients, self.report = path / "coefficients.yaml", path / "report.html"

    def remove(self) -> None:
        """Remove the folder of a run that never began, and those above it that were made for it and are empty."""
        shutil.rmtree(self.path, ignore_errors=True)
        for one in self._made:
            with contextlib.suppress(OSError):  # another run came into it
                one.rmdir()

    @contextlib.contextmanager
    def unless_refused(self) -> Iterator[None]:
        """Remove the folder where what the block asks for is refused: nothing of its run has begun."""
        try:
            yield
        except HindraxError:
            self.remove()
            raise


def make_run_folder(wanted: str | None, vehicle_file: Path, wanted_bytes: int = FREE_BYTES_WANTED) -> RunFolder:
    """Create the folder of a run, with a copy of the vehicle file in it.

    Parameters
    ----------
    wanted
        Folder of the user; None: a new one, named by the time.
    vehicle_file
        Is copied.
    wanted_bytes
        Room that its disk must have [bytes].

    Returns
    -------
    RunFolder
        With a resolved path; it knows which folders above it are new.

    Raises
    ------
    UsageError
        When the folder is occupied or cannot be created.
    HindraxError
        When there is too little room.
    """
    path = Path(wanted) if wanted else new_run(datetime.now(UTC).astimezone())
    if path.exists() and (not path.is_dir() or any(path.iterdir())):
        raise UsageError(f"{path} is occupied; name an empty or new folder with --out")
    whole = path.resolve()
    folder = RunFolder(whole, [one for one in whole.parents if not one.exists()])
    with writing(path, "name another folder with --out"), nothing_left(folder.vehicle):
        path.mkdir(parents=True, exist_ok=True)
        free = shutil.disk_usage(path).free
        if free < wanted_bytes:
            have, want = free // 1_000_000, wanted_bytes // 1_000_000
            raise HindraxError(
                f"the disk of {path} is full: {have} MB are free, {want} MB are wanted; make room or use --out"
            )
        shutil.copyfile(vehicle_file, folder.vehicle)
    return folder


def new_run(now: datetime) -> Path:
    """Folder named by the time, or by a number where the clock was never set; one more where that is taken.

    A computer without a battery clock begins every day at the same time.

    Parameters
    ----------
    now
        Local time.

    Returns
    -------
    Path
        Does not exist yet.
    """
    name = now.strftime("%Y-%m-%d_%H-%M-%S") if now.year >= FIRST_YEAR else "undated"
    numbered = (RUNS / (f"{name}_{number}" if number else name) for number in itertools.count())
    return next(path for path in numbered if not path.exists())


def remove_oldest(runs: Path, most_bytes: float, in_use: Collection[Path]) -> Iterator[str]:
    """Remove runs, the oldest first, until the others take no more than a limit.

    Removed is only what `make_run_folder` made, and never a run in use.

    Parameters
    ----------
    runs
        Folder of all runs.
    most_bytes
        What they may take [bytes].
    in_use
        Resolved paths of runs that stay.

    Yields
    ------
    str
        A sentence for each that was removed, or could not be.
    """
    made = [path.resolve() for path in runs.glob("*") if not path.is_symlink() and RunFolder(path).vehicle.is_file()]
    sizes = {
        path: sum(one.lstat().st_size for one in path.rglob("*") if one.is_file())
        for path in sorted(made, key=lambda one: RunFolder(one).vehicle.stat().st_mtime_ns)
    }
    total = sum(sizes.values())
    for path, size in sizes.items():
        if total > most_bytes and path not in in_use:
            try:
                shutil.rmtree(path)
            except OSError as error:
                yield f"{path}: cannot be removed ({cause(error)})"
                continue
            total -= size
            yield f"{path}: removed, {size / 1e6:.1f} MB; the runs take {total / 1e6:.1f} MB now"


def write_parameters(file: Path, parameters: dict[str, dict[str, object]]) -> list[str]:
    """Write ROS parameters for a process to read them. Of two patterns that name one node the later wins.

    Parameters
    ----------
    file
        Is overwritten.
    parameters
        Value by name, by pattern of node names.

    Returns
    -------
    list[str]
        Arguments for the process.
    """
    blocks = {node: {"ros__parameters": values} for node, values in parameters.items()}
    file.write_text(yaml.safe_dump(blocks, sort_keys=False), encoding="utf-8")
    return ["--ros-args", "--params-file", str(file)]
