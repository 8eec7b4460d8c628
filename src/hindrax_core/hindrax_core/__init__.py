"""Pure foundations: events, bus operations, readings, vehicle file, topics table, knobs."""
