"""Whether one bias and one scale factor explain the readings of a log: tests and their causes."""
