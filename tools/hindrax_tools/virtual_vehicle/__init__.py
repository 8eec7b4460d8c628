"""A Debian machine that is a process, deployed to and then harmed: `python -m hindrax_tools.virtual_vehicle`."""
