"""Learned flow signals for direct-ink-writing, paste and pellet printers."""
