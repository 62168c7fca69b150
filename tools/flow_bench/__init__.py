"""The flow bench: what one cell is, how the matrix is worked through, its targets, table and fronts."""
