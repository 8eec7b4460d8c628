"""Firmware core of the thruster controller: pure Python that runs under MicroPython and under CPython."""
