"""Settings of every test: the same examples on every machine, however busy it is."""

from hypothesis import settings

settings.register_profile("dev", max_examples=50, derandomize=True, deadline=None, database=None)
settings.register_profile("ci", max_examples=500, derandomize=True, deadline=None, database=None)
settings.load_profile("dev")
