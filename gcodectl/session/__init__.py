"""Learning on a machine: trials as files to print, what was measured of them, and what both give; resumable."""
