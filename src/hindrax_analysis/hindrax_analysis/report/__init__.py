"""The report of a run and the comparison of many: one self-contained page for phone, desk and paper, light and dark."""

from hindrax_analysis.published import published_of
from hindrax_analysis.report.comparison import comparison_page
from hindrax_analysis.report.figures import Trace
from hindrax_analysis.report.run_page import RunReport, run_page

__all__ = ["RunReport", "Trace", "comparison_page", "published_of", "run_page"]
