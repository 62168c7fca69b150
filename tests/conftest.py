"""Settings for every test: hypothesis without deadlines (a kernel's first call compiles it), the same every run."""

from hypothesis import settings

settings.register_profile("gate", deadline=None, derandomize=True, max_examples=40)
settings.load_profile("gate")
