"""Motion: limits, look-ahead and jerk-limited profiles."""
