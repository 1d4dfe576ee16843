"""Full calibration on a table of one, two or three axes: steps, signs, blocks, fit."""
