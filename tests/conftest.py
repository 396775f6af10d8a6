"""Property tests draw the same examples in every run; `--hypothesis-profile explore` draws new ones."""

from hypothesis import settings

settings.register_profile("same-every-time", derandomize=True, deadline=None, database=None)
settings.register_profile("all-day", deadline=None, max_examples=7000)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile("same-every-time")
