"""Variance components of a fleet: nested rows, their likelihood, estimates and intervals."""
