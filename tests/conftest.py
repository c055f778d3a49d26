"""Property tests: no time limits on a busy machine, and few examples each."""

from hypothesis import settings

settings.register_profile("most", deadline=None, max_examples=30)
settings.load_profile("most")
