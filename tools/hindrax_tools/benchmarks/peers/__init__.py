"""Processes that benchmarks run beside ours."""
