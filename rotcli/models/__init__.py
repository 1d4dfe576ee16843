"""Physics on arrays: no files, no messages, no settings."""
