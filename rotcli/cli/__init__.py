"""The thin layer of commands: parse, load, call one stage, write."""
