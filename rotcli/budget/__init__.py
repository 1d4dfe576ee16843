"""Error budget of one turn about each axis, and the axis to choose."""
