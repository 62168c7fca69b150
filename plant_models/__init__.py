"""Simulated extruders, gantry, bead and firmware to prove the controllers on; no controller may see them."""
