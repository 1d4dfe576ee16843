"""The content of a recording: segments, alignment, checks."""
