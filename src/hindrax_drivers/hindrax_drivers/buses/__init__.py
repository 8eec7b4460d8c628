"""Ports, clocks and the order of traffic: the only place of the stack that opens, reads, writes or waits."""
