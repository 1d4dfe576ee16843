"""Recordings of laboratory tests: blocks, turn-ons, corrections over rate and temperature."""
