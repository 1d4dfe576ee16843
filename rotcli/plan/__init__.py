"""Plan the sequence of positions and turns that calibrates best in a given time."""
