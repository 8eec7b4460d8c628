"""What share of the mutants that change something the tests kill, in every module that safety and truth hang on.

    python -m hindrax_tools.mutation_table --only "dead man" --sample 30
    python -m hindrax_tools.mutation_table hindrax_core.input_checks src/hindrax_core/test/test_stamp_window.py

`mutation_tests.yaml` lists the modules by area, the tests of each, and mutants that were read and change nothing. Of
each module a sample is tried; what survives is printed, with the line of code as it reads in the mutant. It may also
change nothing: read it before you write a test. The exit code is 1 when less than 95 % are killed in an area; of a
module that is named with its tests all are tried, and all are to be killed.
"""

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import asdict, astuple, dataclass
from pathlib import Path
from typing import Any

import yaml

from hindrax_tools.mutation import MutatedModule, prepare

LIST = Path(__file__).with_name("mutation_tests.yaml")
WANTED, SAMPLE = 0.95, 20


@dataclass(frozen=True, slots=True)
class ListedModule:
    """A module of the list: its tests, and the reason why a mutant changes nothing, by how its line reads then."""

    area: str
    module: str
    tests: tuple[str, ...]
    same: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class MutationRow:
    """A line of the table: counts of mutants; `known`: all there are; `changing`: those tried that change something."""

    name: str
    known: int
    tried: int
    changing: int
    killed: int

    @property
    def share(self) -> float:
        """Killed of those that change something."""
        return self.killed / self.changing if self.changing else 1.0

    def __str__(self) -> str:
        return f"| {' | '.join(map(str, astuple(self)))} | {100 * self.share:.0f} % |"


def listed() -> list[ListedModule]:
    """The list, in its order."""
    areas: Mapping[str, Mapping[str, Mapping[str, Any]]] = yaml.safe_load(LIST.read_text(encoding="utf-8"))
    return [
        ListedModule(area, module, tuple(entry["tests"]), entry.get("same", {}))
        for area, modules in areas.items()
        for module, entry in modules.items()
    ]


def measure(entry: ListedModule, options: argparse.Namespace) -> MutationRow:
    """Try a sample of the mutants of a module, as far as the time goes."""
    tested = MutatedModule(entry.module, entry.tests)
    # The code has changed since these were read.
    for line in sorted(set(entry.same) - {one.reads for one in tested.known}):
        print(f"{entry.module}: no mutant reads: {line}; take it out of {LIST.name}", file=sys.stderr)
    chosen = tested.sampled(options.sample, options.seed, options.grep)
    tried, left = tested.try_mutants(chosen, options.seconds)
    same = [one for one in left if one.reads in entry.same]
    return MutationRow(entry.module, len(tested.known), tried, tried - len(same), tried - len(left))


def total(name: str, rows: Sequence[MutationRow]) -> MutationRow:
    """The sum of rows."""
    return MutationRow(name, *(sum(column) for column in zip(*(astuple(row)[1:] for row in rows), strict=True)))


def main(words: Sequence[str] | None = None) -> int:
    """Print the table; 1 when an area is below what is wanted."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("module", nargs="?", help="only this one, as it is imported")
    parser.add_argument("tests", nargs="*", help="its tests, files or names of tests, arguments of pytest")
    parser.add_argument(
        "--only", action="append", default=[], metavar="NAME", help="area or module, more than once for more"
    )
    parser.add_argument("--sample", type=int, metavar="N", help=f"mutants of each module; of the list {SAMPLE}")
    parser.add_argument("--grep", default="", help="only mutants of source lines with this text")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument("--seconds", type=float, default=600.0, help="time for the mutants of each module")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows of the modules there as well")
    options = parser.parse_args(words)
    if options.module and not options.tests:
        parser.error(f"{options.module}: found no tests, wanted files or names of tests behind it")
    prepare()
    if options.module:
        entries, wanted = [ListedModule("named", options.module, tuple(options.tests), {})], 1.0
    else:
        options.sample, wanted = options.sample or SAMPLE, WANTED
        entries = [one for one in listed() if not options.only or {one.area, one.module} & set(options.only)]
    if not entries:
        parser.error(f"--only: no such area or module; there are {', '.join(sorted({one.area for one in listed()}))}")
    rows: dict[str, list[MutationRow]] = {}
    for entry in entries:
        try:
            rows.setdefault(entry.area, []).append(measure(entry, options))
        except (LookupError, AssertionError) as error:
            parser.error(str(error))
        print(rows[entry.area][-1], flush=True)
        if options.json:
            options.json.write_text(json.dumps([asdict(row) for area in rows.values() for row in area], indent=1))
    areas = [total(area, ones) for area, ones in rows.items()]
    print("\n| area | mutants | tried | that change something | killed | share |\n|---|---|---|---|---|---|")
    for row in [*areas, total("all", areas)]:
        print(row)
    return int(any(row.share < wanted for row in areas))


if __name__ == "__main__":
    sys.exit(main())
