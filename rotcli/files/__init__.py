"""Files: atomic writes, text dialects, TOML, result documents, tables and figures."""
