"""The published tables, recomputed from their printed inputs: one module per paper, `recompute()` gives its cells."""

from functools import cache

from hindrax_laboratory.papers import badawy_2012, cob_2023_1394, cob_2023_2422, eidsvik_2015, xu_2017
from hindrax_laboratory.papers.cells import Cell


@cache
def recompute() -> tuple[Cell, ...]:
    """Every cell of every paper, in the order of the papers A to E."""
    papers = (cob_2023_1394, cob_2023_2422, xu_2017, eidsvik_2015, badawy_2012)
    return tuple(cell for paper in papers for cell in paper.recompute())
