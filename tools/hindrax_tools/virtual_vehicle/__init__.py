"""A Debian machine under emulation on which the project is deployed and harmed: `python -m hindrax_tools.virtual_vehicle`."""
