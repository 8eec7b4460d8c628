"""The words of the tool: one module per command, found by its file.

A command module declares NAME, HELP (one line) and EXAMPLE, and offers `add_arguments(parser)` and
`run(arguments) -> int`. Exit codes: 0 done, 1 the work failed (HindraxError), 2 wrong use (UsageError),
130 interrupted by Ctrl-C.
"""
