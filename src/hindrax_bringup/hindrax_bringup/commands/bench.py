"""`hindrax bench`: speed, each figure beside a peer measured in the same run."""

from __future__ import annotations

import argparse
import importlib
import json
import pkgutil
import sys
from typing import Any

from rich.console import Console
from rich.table import Table

from hindrax_bringup import benchmarks
from hindrax_core.errors import UsageError

NAME = "bench"
HELP = "speed, each figure beside a peer in the same run"
EXAMPLE = "./hindrax bench rls allocation"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which benchmarks, and how to print."""
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"some of: {', '.join(names())}; default all")
    parser.add_argument("--json", action="store_true", help="one JSON document on stdout")


def names() -> list[str]:
    """Names of all benchmarks."""
    return sorted(module.name for module in pkgutil.iter_modules(benchmarks.__path__) if module.name[0] != "_")


def run(arguments: argparse.Namespace) -> int:
    """Measure and print."""
    wanted = arguments.names or names()
    unknown = [name for name in wanted if name not in names()]
    if unknown:
        raise UsageError(f"no benchmark {unknown[0]!r}; there are {', '.join(names())}")
    rows: list[dict[str, Any]] = []
    for name in wanted:
        print(f"measuring {name} ...", file=sys.stderr, flush=True)
        rows += importlib.import_module(f"{benchmarks.__name__}.{name}").rows()
    if arguments.json:
        print(json.dumps({"rows": rows}))
    else:
        show(rows)
    return 0


def show(rows: list[dict[str, Any]]) -> None:
    """Print a table."""
    table = Table(title="Medians; the ratio is peer / ours")
    for heading in ("what", "ours, us", "peer", "peer, us", "ratio"):
        table.add_column(heading, justify="left" if heading in ("what", "peer") else "right")
    for row in rows:
        table.add_row(row["name"], *(_cell(row.get(key)) for key in ("ours_us", "peer", "peer_us", "ratio")))
    Console().print(table)


def _cell(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value if value is not None else "")
