"""Compiled kernels, kept on disk: what one is made of, where it is kept, how it is built, loaded and called."""
