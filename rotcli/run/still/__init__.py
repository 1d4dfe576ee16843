"""The still record of an IMU log: its clean segments, and the disturbances between them."""
