"""A remedy is followed by a command that the tool has, or in a world of the mock without a condition that it has."""

import pytest

from hindrax_cli import command_line
from hindrax_ident.assess.influences import INFLUENCES
from hindrax_sim.conditions.world_table import CONDITIONS

REMEDIES = {row.remedy for row in INFLUENCES}


@pytest.mark.parametrize("command", sorted({one.command for one in REMEDIES} - {""}))
def test_commands_are_those_of_the_tool(command: str) -> None:
    tool, name, *words = command.split()
    assert tool == "./hindrax"
    ending: object = 0
    try:
        command_line.parser_of(command_line.load(name)).parse_args(words)
    except SystemExit as end:  # as --help and errors do
        ending = end.code
    assert not ending


def test_conditions_are_those_of_a_world() -> None:
    named = {one.condition for one in REMEDIES} - {""}
    assert named
    assert named <= set(CONDITIONS)
