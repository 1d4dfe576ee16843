"""Kinds of log files: header, text, Parquet and bags as columns of numbers."""
