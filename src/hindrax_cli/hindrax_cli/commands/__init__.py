"""The words of the tool, by theme; `hindrax_cli/command.py` has the table of them and what a command is."""
