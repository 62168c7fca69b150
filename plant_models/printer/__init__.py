"""A printer that needs no hardware: firmware protocol, heaters, faults, and a port to plug a host into."""
