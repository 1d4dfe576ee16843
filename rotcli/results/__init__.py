"""Results to files, tables, plots and pages."""
