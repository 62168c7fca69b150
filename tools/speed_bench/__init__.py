"""The speed bench's parts: inputs, processes, cells, start-up, peers, profiles, tables."""
