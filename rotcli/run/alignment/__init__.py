"""Whether the clocks of gyros and table agree: lag, difference in rate, and sense."""
