"""Checks of a log for the ZUPT filter: window and rates, readings, disturbances, set-up."""
