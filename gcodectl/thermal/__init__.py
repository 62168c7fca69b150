"""Heat: how a surface cools between layers, seen or foretold, and when and how fast the next road may be laid."""
