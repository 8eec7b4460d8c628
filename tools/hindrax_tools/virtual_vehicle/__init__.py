"""A Debian machine under emulation, deployed to and then harmed: `python -m hindrax_tools.virtual_vehicle`."""
