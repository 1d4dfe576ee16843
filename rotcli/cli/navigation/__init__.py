"""Commands that navigate."""
