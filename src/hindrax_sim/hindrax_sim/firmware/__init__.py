"""Firmware core of the thruster controller: pure Python for MicroPython and CPython."""
