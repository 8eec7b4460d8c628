"""Offline analysis of records: identification, reports, exports, bench experiments, papers."""
