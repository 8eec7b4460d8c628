"""YAML of any author: plain data, in bounded time and memory, without what YAML 1.1 reads otherwise than people do."""

from typing import Any

import yaml

from hindrax_core.errors import UsageError

DEPTH, NODES, ALIASES, DIGITS = 40, 200_000, 100, 40
"""Bounds of a file: nested blocks, values, repeated blocks (`*name`), digits of a number."""
_OPENING = (yaml.events.MappingStartEvent, yaml.events.SequenceStartEvent)
_CLOSING = (yaml.events.MappingEndEvent, yaml.events.SequenceEndEvent)
_SafeLoader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


class _Loader(_SafeLoader):  # type: ignore[misc]  # either of two classes
    """A safe loader that refuses numbers to the base 60 and numbers without end."""

    def construct_number(self, node: yaml.ScalarNode) -> object:
        """Check how a number is written, then read it."""
        if ":" in node.value:
            _refuse(
                f"{node.value}, which YAML reads to the base 60", 'a decimal number, or a text in quotes: "1:30"', node
            )
        if len(node.value) > DIGITS:
            _refuse(f"a number of {len(node.value)} characters", f"at most {DIGITS}", node)
        return _SafeLoader.yaml_constructors[node.tag](self, node)


for _tag in ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float"):
    _Loader.add_constructor(_tag, _Loader.construct_number)


def read_yaml(text: str, source: str) -> Any:
    """Return the plain data of a YAML text; UsageError names `source`, the line, what was found and what was wanted."""
    try:
        _check_size(text)
        loader = _Loader(text)
        node = loader.get_single_node()
        if node is None:
            return None
        _check_keys(node, set())
        return loader.construct_document(node)
    except yaml.YAMLError as error:
        if "nesting depth" in str(error):  # newer parsers have a bound of their own, and meet it before ours is checked
            mark = error.problem_mark if isinstance(error, yaml.MarkedYAMLError) else None
            where = f", line {mark.line + 1}" if mark else ""
            raise UsageError(f"{source}: found more than {DEPTH} nested blocks{where}; wanted fewer") from error
        raise UsageError(f"{source}: is not YAML ({' '.join(str(error).split())})") from error
    except ValueError as error:
        raise UsageError(f"{source}: {error}") from error


def _check_size(text: str) -> None:
    """Check the bounds without building anything: building nests calls and copies repeated blocks."""
    depth = nodes = aliases = 0
    for event in yaml.parse(text, _SafeLoader):
        depth += isinstance(event, _OPENING) - isinstance(event, _CLOSING)
        nodes += isinstance(event, yaml.events.NodeEvent)
        aliases += isinstance(event, yaml.events.AliasEvent)
        for found, most, what in (
            (depth, DEPTH, "nested blocks"),
            (nodes, NODES, "values"),
            (aliases, ALIASES, "repeated blocks"),
        ):
            if found > most:
                _refuse(f"more than {most} {what}", "fewer", event)


def _check_keys(node: yaml.Node, seen: set[int]) -> None:
    """Check that no key hides another; depth is bounded by now."""
    if id(node) in seen or isinstance(node, yaml.ScalarNode):
        return
    seen.add(id(node))
    first: dict[str, yaml.Node] = {}
    for one in node.value:
        key, value = one if isinstance(node, yaml.MappingNode) else (None, one)
        if isinstance(key, yaml.ScalarNode):
            if key.value in first:
                _refuse(f"the key {key.value} again, first {_line(first[key.value])}", "each key once", key)
            first[key.value] = key
        _check_keys(value, seen)


def _refuse(found: str, wanted: str, where: yaml.Node | yaml.Event) -> None:
    raise ValueError(f"found {found}, {_line(where)}; wanted {wanted}")


def _line(where: yaml.Node | yaml.Event) -> str:
    assert where.start_mark is not None  # the parser sets it
    return f"line {where.start_mark.line + 1}"
