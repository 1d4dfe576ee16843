"""Full calibration without a table: still poses and moves, recorded by hand."""
