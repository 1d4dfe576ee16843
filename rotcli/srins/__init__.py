"""Single-axis rotation INS (SRINS): simulation, calibration, observability."""
