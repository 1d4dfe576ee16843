"""Simulated voyages of an SRINS: scenario, true motion, logs."""
