"""The layout of a log: columns, units and time, found from names, rig and values."""
