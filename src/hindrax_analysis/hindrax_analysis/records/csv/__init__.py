"""Records of CSV files of any origin: names and units of columns, axes, angles, clocks, thrusters."""
