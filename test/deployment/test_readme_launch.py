"""The launch file in the README of each package: executables, parameters, remapped topics and arguments exist.

A stand-in for launch, which is not among the wheels of ROS, takes down what the example says.
"""

import re
from configparser import ConfigParser
from pathlib import Path
from typing import Any

import pytest
from documentation.pages import ROOT
from launch_stand_in import Said, actions_of, put_in_place

from hindrax_bringup.network.security import ROLES
from hindrax_core.knobs import leaves
from hindrax_operator.node_parameters import NODES, OF_ONE_NODE, TEXTS
from hindrax_tools.reference.graph import edges

READMES = {file.parent.name: file for file in sorted(ROOT.glob("src/*/README.md"))}
LAUNCH = re.compile(r"```python\n(from launch import .*?)```", re.DOTALL)
EXAMPLES = {name: found[1] for name, file in READMES.items() if (found := LAUNCH.search(file.read_text("utf-8")))}
"""By package."""


def test_every_package_with_nodes_has_an_example() -> None:
    assert EXAMPLES.keys() == {f"hindrax_{name}" for name in ("bag", "bringup", "control", "drivers", "ident")}


@pytest.mark.parametrize("package", EXAMPLES)
def test_a_launch_file_names_what_there_is(package: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    included: list[dict[str, Any]] = []

    def take(kind: str, *words: Any, **keywords: Any) -> Said:
        if kind == "IncludeLaunchDescription":
            included.append({"file": words[0].words[0].words[0], "given": dict(keywords["launch_arguments"])})
        return Said(kind, words, keywords)

    put_in_place(monkeypatch, take)
    file = tmp_path / "readme.launch.py"
    file.write_text(EXAMPLES[package], encoding="utf-8")
    actions = actions_of(file)
    nodes = [one.keywords for one in actions if one.kind == "Node"]
    assert nodes or included
    for node in nodes:
        check_node(**node)
    for one in included:
        share, *path = one["file"]
        (name,) = share.words
        described = actions_of(ROOT / "src" / name / Path(*path))
        assert one["given"].keys() <= {said.words[0] for said in described if said.kind == "DeclareLaunchArgument"}


def check_node(
    *, package: str, executable: str, namespace: str, parameters: Any, arguments: Any = (), remappings: Any = ()
) -> None:
    setup = ConfigParser()
    setup.read(ROOT / "src" / package / "setup.cfg")
    assert re.search(rf"^{executable} = ", setup["options.entry_points"]["console_scripts"], re.MULTILINE)
    assert re.fullmatch(r"\w+", namespace)
    (name,) = arguments or (executable,)
    known = {*TEXTS, *OF_ONE_NODE.get(name, ())} | {leaf for kind in NODES[name] for leaf in leaves(kind)}
    (given,) = parameters
    assert given.keys() <= known
    (role,) = (one for one in ROLES if one.node == name)
    topics = {found.removeprefix("/hindrax/") for _, found, _ in edges(role)}
    assert {topic for topic, _ in remappings} <= topics
