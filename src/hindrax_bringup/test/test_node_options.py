"""Parameters of the nodes: three sources in their order, and names that no node has."""

from pathlib import Path

import pytest

from hindrax_bringup.node_options import NodeOptions, ParameterOverrides
from hindrax_bringup.processes import CONTROL
from hindrax_core.errors import UsageError
from hindrax_core.topics import DIAGNOSTICS, NAVIGATION, in_default_namespace, resolved

FILE = """
/**/pilot: {ros__parameters: {holds: {turn_radps: 0.2, sink_mps: 0.1}}}
/rov1/pilot: {ros__parameters: {holds.turn_radps: 0.25}}
/**/piloot: {ros__parameters: {holds.turn_radps: 0.3}}
"""


def tuned(folder: Path, *settings: str, text: str = FILE, namespace: str = "/rov1") -> NodeOptions:
    file = folder / "mine.yaml"
    file.write_text(text, encoding="utf-8")
    return NodeOptions("vehicle.yaml", ParameterOverrides(namespace, str(file), settings))


def test_what_is_set_wins_over_the_file_in_every_block_that_names_the_node(tmp_path: Path) -> None:
    blocks = tuned(tmp_path, "pilot.holds.turn_radps:=1").parameters()
    assert blocks["/**/pilot"] == {"holds.turn_radps": 1, "holds.sink_mps": 0.1}
    assert blocks["/rov1/pilot"] == {"holds.turn_radps": 1}
    assert blocks["/**/piloot"] == {"holds.turn_radps": 0.3}


def test_the_file_wins_over_what_the_stack_states_itself(tmp_path: Path) -> None:
    text = "/**: {ros__parameters: {vehicle: mine.yaml}}"
    blocks = tuned(tmp_path, text=text).parameters()
    assert blocks["/**"]["vehicle"] == "mine.yaml"


def test_a_block_for_nobody_is_reported(tmp_path: Path) -> None:
    (sentence,) = tuned(tmp_path).unknown_blocks()
    assert "'/**/piloot' names no node of this stack, ignored" in sentence
    assert any("'/rov1/pilot'" in one for one in tuned(tmp_path, namespace="/rov2").unknown_blocks())


@pytest.mark.parametrize(
    ("setting", "why"),
    [
        ("pilot", "wanted node.name:=value"),
        ("pilot:=1", "wanted node.name:=value"),
        ("piloot.holds.turn_radps:=1", "no node is called 'piloot'; the nearest is 'pilot'"),
        ("pilot.holds.turn_radps:=[1", "the value is no YAML"),
    ],
)
def test_a_setting_that_is_none_costs_one_sentence(setting: str, why: str) -> None:
    with pytest.raises(UsageError, match=why.replace(".", r"\.")):
        NodeOptions("vehicle.yaml", ParameterOverrides(settings=(setting,))).parameters()


@pytest.mark.parametrize("text", ["[]", "pilot: 1", "{", "pilot: {ros__parameters: 3}"])
def test_a_file_that_is_none_costs_one_sentence(tmp_path: Path, text: str) -> None:
    with pytest.raises(UsageError, match=r"mine\.yaml"):
        tuned(tmp_path, text=text).parameters()


@pytest.mark.parametrize("namespace", ["rov1", "/", "/rov1/", "/1rov", "/rov 1", "/rov__1", ""])
def test_a_namespace_that_is_none_costs_one_sentence(namespace: str) -> None:
    with pytest.raises(UsageError, match="wanted names of letters"):
        ParameterOverrides(namespace)


def test_a_vehicle_of_another_name_has_the_shared_topics_inside() -> None:
    own = NodeOptions("v", ParameterOverrides("/rov1"), wires={"ports": {}, "clock": ""}).arguments(CONTROL)
    assert own[:2] == ["-r", "__ns:=/rov1"]
    assert {"/clock:=clock", "/tf:=tf", "/diagnostics:=diagnostics"} <= set(own)
    assert "/clock:=clock" not in NodeOptions("v", ParameterOverrides("/rov1")).arguments(CONTROL), (
        "a real one has no own clock"
    )
    assert NodeOptions("v").arguments(CONTROL) == ["--enclave", "/hindrax/control"]
    for topic in (NAVIGATION, DIAGNOSTICS):
        inside = f"/rov1/{topic.name.lstrip('/')}"
        assert in_default_namespace(inside, "/rov1") == resolved(topic)
        assert in_default_namespace(inside, "/rov2") == inside
