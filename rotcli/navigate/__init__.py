"""Conventional, partially and fully calibrated rotary navigation, and its errors."""
