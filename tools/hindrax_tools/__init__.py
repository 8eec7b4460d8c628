"""Tools of the developers, never installed on a vehicle: benchmarks, and the writer of the reference pages."""
