"""Models of laboratory tests: blocks of a log, errors over rate, temperature and time."""
