"""G-code: bytes to moves and back."""
