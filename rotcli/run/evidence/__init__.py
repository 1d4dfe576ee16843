"""What the logs of a recording show against each other, check by check."""
