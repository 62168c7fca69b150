"""The thermal bench's parts: the camera, the controls, tables."""
