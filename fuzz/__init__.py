"""Readers under coverage-guided fuzzing: `python -m fuzz READER --seconds 60`, or `make fuzz`.

`readers` holds one function for each reader, which lets nothing but RotcliError pass in silence.
"""
