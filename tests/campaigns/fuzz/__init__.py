"""Readers under coverage-guided fuzzing: `make fuzz`.

`python -m tests.campaigns.fuzz READER --seconds 60` fuzzes one of them.

`readers` has one function for each reader, which lets nothing but RotcliError pass in silence.
"""
