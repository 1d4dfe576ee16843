"""Observability of a motion, and the zero-velocity (ZUPT) filter."""
