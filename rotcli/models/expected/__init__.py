"""Expected errors of a navigation run, before and beside the observed ones."""
