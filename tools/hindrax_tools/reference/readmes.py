"""Nodes of a package in its README: what each reads, publishes and serves, and where its parameters are.

Written between two marks; the rest of a README is written by hand.
"""

import re
from collections.abc import Collection, Iterator
from pathlib import Path

from hindrax_bringup.network.security import ROLES, Role
from hindrax_bringup.processes import EVERY
from hindrax_core.sensor_table import SENSORS
from hindrax_core.topics import NAMESPACE
from hindrax_operator.node_parameters import NODES
from hindrax_tools.reference.graph import ALONE, MEANINGS, edges
from hindrax_tools.reference.markdown import code, table
from hindrax_tools.reference.parameters import rows

BEGIN = "<!-- nodes: written by `./hindrax reference --write` -->"
END = "<!-- end of nodes -->"
COLUMNS = ("node", "subscribes", "publishes", "services and actions", "parameters")
VERBS = ("subscribes", "publishes", "serves")
MOST = 20
"""Names in a cell; only the recorder has more, and it has all."""
OF_EVERY = ("/diagnostics", "/tf", "/tf_static", "/rosout")
"""Not worth a word in each row."""
REFERENCE = "../../docs/reference"


def stale(root: Path) -> dict[Path, str]:
    """Text by file of the READMEs whose list of nodes differs from the code."""
    made: dict[Path, str] = {}
    for file in sorted(root.glob("src/*/README.md")):
        text = file.read_text(encoding="utf-8")
        found = re.search(rf"{re.escape(BEGIN)}\n.*?{re.escape(END)}\n", text, re.DOTALL)
        if wanted := nodes_of(file.parent.name):
            section = f"{BEGIN}\n{wanted}{END}\n"
            new = text.replace(found[0], section) if found else f"{text.rstrip()}\n\n{section}"
            if new != text:
                made[file] = new
    return made


def write(root: Path) -> list[Path]:
    """Write the READMEs that are stale; returns their files."""
    changed = stale(root)
    for file, text in changed.items():
        file.write_text(text, encoding="utf-8")
    return list(changed)


def nodes_of(package: str) -> str:
    """Table of the nodes of a package, but those of sensors; empty without any."""
    found = [_row(role) for role in ROLES if _package(role) == package and role.node not in _sensors()]
    names = f"Names are relative to the namespace, `{NAMESPACE}` unless remapped; types: [nodes]({REFERENCE}/nodes.md)."
    return f"\n**Nodes**\n\n{table(COLUMNS, found)}\n{names}\n" if found else ""


def _package(role: Role) -> str:
    """Package of the executable that hosts a node; empty for the operator's."""
    alone = ALONE.get(role.node, "").split()
    return alone[2] if alone else next((one.package for one in EVERY if one.name == role.enclave), "")


def _sensors() -> Iterator[str]:
    return (sensor.name for sensor in SENSORS)


def _row(role: Role) -> tuple[str, ...]:
    listed = [(verb, name.removeprefix(f"{NAMESPACE}/")) for verb, name, _ in edges(role) if name not in OF_EVERY]
    cells = (_cell(dict.fromkeys(name for verb, name in listed if verb == wanted)) for wanted in VERBS)
    count = sum(1 for kind in NODES.get(role.node, ()) for _ in rows(kind))
    parameters = f"[{count}]({REFERENCE}/parameters.md#{role.node})" if count else ""
    return (f"`{role.node}`: {MEANINGS[role.node]}", *cells, parameters)


def _cell(names: Collection[str]) -> str:
    return "every topic of the stack" if len(names) > MOST else ", ".join(map(code, names))
