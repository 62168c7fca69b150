"""Measuring from photographs: a sheet of markers, the camera found from it, the road found on it, and its width."""
