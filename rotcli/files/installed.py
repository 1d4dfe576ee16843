"""The files that are installed with the package: profiles, scenarios, schemas, pages."""

from pathlib import Path

# `importlib.resources` finds them too, and imports archives and temporary files for it (5 ms).
DATA = Path(__file__).parents[1] / "data"
