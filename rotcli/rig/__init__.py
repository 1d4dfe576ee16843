"""The set-up: rig.toml, profiles and scenarios."""
