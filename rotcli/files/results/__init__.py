"""Result documents: provenance, validation, identity of the device, grouping."""
