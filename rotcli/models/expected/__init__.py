"""Expected errors of a navigation run, before and next to the observed ones."""
