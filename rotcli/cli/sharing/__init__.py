"""Commands that pass results on."""
