"""The learning bench: real calibrations left out a material at a time, and a simulated operator who calibrates."""
