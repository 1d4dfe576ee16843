"""Noise analysis: Allan deviation, noise coefficients, Gauss-Markov figures."""
