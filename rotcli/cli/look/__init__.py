"""Commands that look at logs."""
