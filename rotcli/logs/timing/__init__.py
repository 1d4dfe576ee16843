"""Time stamps to an even clock."""
