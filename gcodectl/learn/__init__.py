"""Iterative learning control: finding the signals."""
