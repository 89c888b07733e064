"""Each check of a log: clocks, axes, units, rotor order, contact."""
