"""The virtual printer: a firmware that takes lines, plans as it goes, and lays a bead."""
