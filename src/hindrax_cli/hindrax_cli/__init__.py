"""The command line tool hindrax."""
