"""A first guess for a new material: calibrations that are known, and what they say of one that is not."""
