"""Argument types shared by several commands."""

from __future__ import annotations

import argparse
import math


def positive(text: str) -> float:
    """Argument type: a finite number above zero."""
    number = float(text)
    if not (math.isfinite(number) and number > 0.0):
        raise argparse.ArgumentTypeError(f"{text} is not above 0")
    return number


def pace(text: str) -> float:
    """Argument type: times real time, 0 for no bound."""
    number = float(text)
    if not (math.isfinite(number) and number >= 0.0):
        raise argparse.ArgumentTypeError(f"found {text}, wanted 0 (no bound) or more")
    return number


def seed(text: str) -> int:
    """Argument type: seed of everything random; goals carry it in 32 bits."""
    number = int(text)
    if not 0 <= number < 1 << 32:
        raise argparse.ArgumentTypeError(f"found {text}, wanted 0 to {(1 << 32) - 1}")
    return number
