"""The commands by theme; `hindrax_cli/command.py` has their table and the declaration of a command."""
