"""The report of a run and the comparison of many: one self-contained page for phone, desk and paper, light and dark."""
