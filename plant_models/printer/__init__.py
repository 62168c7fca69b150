"""A printer that needs no hardware: firmware protocol and planning, heaters, faults, bead, and a port for a host."""
