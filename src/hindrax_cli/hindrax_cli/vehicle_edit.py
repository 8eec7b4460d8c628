"""Changes values of a vehicle file; comments, order and style stay."""

import argparse
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import yaml

from hindrax_analysis.records.autopilot_vehicle import Wiring
from hindrax_bringup.share_files import simulated_vehicle, vehicle_file
from hindrax_cli.command import option
from hindrax_core.errors import UsageError, cause
from hindrax_core.text.text_file import replace_text, require_place
from hindrax_core.vehicle import vehicle_from_text


def set_key(file: Path, keys: Sequence[str], value: object) -> None:
    """Set a value in a vehicle file, which must be valid after it; UsageError where that cannot be.

    Parameters
    ----------
    file
        Of the vehicle.
    keys
        Path to the value; the last key is added where it is missing.
    value
        As YAML can hold it.
    """
    set_keys(file, [(keys, value)])


def set_keys(file: Path, values: Sequence[tuple[Sequence[str], object]]) -> None:
    """Set several values at once: all of them, or none; UsageError where that cannot be."""
    try:
        changed = file.read_text(encoding="utf-8")
        for keys, value in values:
            changed = edited(changed, keys, value, str(file))
        vehicle_from_text(changed, str(file))
        replace_text(file, changed)
    except OSError as error:
        raise UsageError(f"{file}: cannot be changed ({cause(error)})") from error


add_write = option("--write", action="store_true", help="put the result into the vehicle file")


def require_editable(arguments: argparse.Namespace) -> None:
    """UsageError where `keep` cannot write what --write asks for, raised before anything is measured."""
    if arguments.write:
        require_place(Path(arguments.vehicle), "--write: ")


def keep(arguments: argparse.Namespace, keys: Sequence[str], value: object, where: str = "") -> str:
    """Set a value in the vehicle file if --write asks for it.

    Parameters
    ----------
    arguments
        With `vehicle` and `write`.
    keys, value
        As of `set_key`.
    where
        Name of the place in the sentence; empty: the file.

    Returns
    -------
    str
        Where it is now, or how to keep it.
    """
    if not arguments.write:
        return f"not saved; --write saves it to {where or 'the vehicle file'}"
    set_key(Path(arguments.vehicle), keys, value)
    return f"written to {where or arguments.vehicle}"


def edited(text: str, keys: Sequence[str], value: object, source: str) -> str:
    """Set a value in the text of a vehicle file, and leave the rest as it stands, comments too.

    Parameters
    ----------
    text
        YAML.
    keys
        Path to the value; the key of an entry of a list is its `name`.
    value
        As YAML can hold it.
    source
        Of the text, for errors.

    Returns
    -------
    str
        The changed text.

    Raises
    ------
    UsageError
        Where there is no such block.
    """
    node: yaml.Node | None = yaml.compose(text, Loader=yaml.SafeLoader)
    for depth, key in enumerate(keys[:-1]):
        node = _child(node, key)
        if not isinstance(node, yaml.CollectionNode):
            raise UsageError(f"{source}: found no block {'.'.join(keys[: depth + 1])}, wanted one to change")
    found = _child(node, keys[-1])
    if found is not None:
        return text[: found.start_mark.index] + _in_the_style_of(found, value) + text[_end(text, found) :]
    if not isinstance(node, yaml.CollectionNode):
        raise UsageError(f"{source}: found no block of keys, wanted one to change")
    written = on_one_line(value)
    if node.flow_style:
        end = node.end_mark.index - 1
        separator = ", " if node.value else ""
        return f"{text[:end]}{separator}{keys[-1]}: {written}{text[end:]}"
    first = node.value[0][0].start_mark
    return f"{text[: first.index]}{keys[-1]}: {written}\n{' ' * first.column}{text[first.index :]}"


def _child(node: yaml.Node | None, key: str) -> yaml.Node | None:
    if isinstance(node, yaml.SequenceNode):
        return next((one for one in node.value if getattr(_child(one, "name"), "value", None) == key), None)
    pairs = node.value if isinstance(node, yaml.MappingNode) else []
    return next((value for name, value in pairs if name.value == key), None)


def _in_the_style_of(node: object, value: object) -> str:
    """The value as text: a block on separate lines where it replaces a block, else on one line."""
    if not (isinstance(value, dict) and value and isinstance(node, yaml.MappingNode) and not node.flow_style):
        return on_one_line(value)
    lines = yaml.safe_dump(value, default_flow_style=None, sort_keys=False, width=10_000).splitlines()
    return f"\n{' ' * node.start_mark.column}".join(lines)


def on_one_line(value: object) -> str:
    """Return a value as YAML on one line, the keys of a mapping in their order."""
    return yaml.safe_dump([value], sort_keys=False, default_flow_style=True, width=10_000).strip()[1:-1]


def _end(text: str, node: yaml.Node) -> int:
    """End of a value: a block ends with its last entry, not with the comments below it; lines keep their end."""
    if isinstance(node, yaml.CollectionNode) and not node.flow_style and node.value:
        last = node.value[-1]
        return _end(text, last[1] if isinstance(last, tuple) else last)
    end = int(node.end_mark.index)
    while end > node.start_mark.index and text[end - 1] in " \n":
        end -= 1
    return end


def with_outputs(text: str, name: str, motors: Mapping[int, tuple[int, bool]]) -> str:
    """Give a vehicle file another name, and its thrusters other channels and senses.

    Parameters
    ----------
    text
        Of a file of the box, with a line for each thruster T1 to Tn.
    name
        Of the vehicle.
    motors
        Channel, and whether it is reversed, by the number of the thruster.

    Returns
    -------
    str
        The changed text.
    """
    lines = []
    for line in text.splitlines():
        found = re.match(r"( *- \{name: T(\d+), channel: )\d+(.*)\}(.*)$", line)
        if line.startswith("name:"):
            lines.append(f"name: {name}")
        elif found and int(found[2]) in motors:
            channel, backwards = motors[int(found[2])]
            lines.append(f"{found[1]}{channel}{found[3]}{', reversed: true' if backwards else ''}}}{found[4]}")
        else:
            lines.append(line)
    return "\n".join(lines) + "\n"


VECTORED = 1
"""FRAME_CONFIG of six thrusters."""


def text_behind(wiring: Wiring) -> str:
    """Text of the vehicle file that belongs to an ArduSub with a frame of the box: that of the box, or its simulator's.

    Parameters
    ----------
    wiring
        Whose `kind` is not empty.

    Returns
    -------
    str
        With the outputs and senses of the box.
    """
    file = simulated_vehicle() if wiring.simulated else vehicle_file(wiring.kind)
    text = file.read_text(encoding="utf-8")
    return _with_two_verticals(text) if wiring.simulated and wiring.frame == VECTORED else text


def _with_two_verticals(text: str) -> str:
    """Make the simulator's `vectored` of the text of its `vectored_6dof`: two vertical thrusters, abeam."""
    text = re.sub(r"^ *- \{name: T[78],.*\n", "", text, flags=re.MULTILINE)
    return re.sub(r"(name: T[56],.*position_m: \[)[^,]+", r"\g<1>0.0", text)


def with_autopilot(text: str, address: str, low_V: float) -> str:
    """Put a vehicle file of the box behind an ArduSub.

    Sensors that are not the autopilot's become comments: it does not know what else is on board.

    Parameters
    ----------
    text
        Of the file.
    address
        Of the autopilot; empty: output and sensors stay.
    low_V : [V]
        Lowest voltage; 0: as it is.

    Returns
    -------
    str
        The changed text.
    """
    if low_V > 0.0:
        text = re.sub(r"(battery_V: )[0-9.]+", rf"\g<1>{low_V:g}", text)
    if address:
        text = re.sub(r'(device: ardusub, port: )"[^"]*"', rf'\g<1>"{address}"', text)
        text = re.sub(r"^  (\w+: \{device: (?!ardusub).*port: /dev/)", r"  # \1", text, flags=re.MULTILINE)
    return text
