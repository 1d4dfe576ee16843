"""Numerical tools: quantiles and triangular systems without scipy, threads of BLAS."""
