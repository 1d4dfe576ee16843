"""Find filters, lines, clipping and drift in a still log before the fit."""
