"""Commands that test sensors."""
