"""Shared by all nodes: messages, qualities, parameters, health, process loop."""

import sys

# rclpy imports the generator of message classes with its type support: a parser that takes 10 % of a node's start and
# 4 MB, and that no node uses. Python takes None for "not there", which rosidl_generator_py allows for.
sys.modules.setdefault("rosidl_generator_py.generate_py_impl", None)  # type: ignore[arg-type]
