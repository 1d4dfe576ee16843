"""Campaigns of navigation results: R16's tables, ratios to the expectation, published means."""
