"""Commands that plan a test."""
