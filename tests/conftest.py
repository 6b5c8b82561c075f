"""Puts the folder of the stand-ins that tests share on the path; the same examples in every run."""

import os

from hypothesis import settings

# A suite that passes here has to pass elsewhere; HYPOTHESIS_PROFILE=search looks for new examples, and more of them.
settings.register_profile("same", derandomize=True, deadline=None, database=None)
settings.register_profile("search", max_examples=1000, deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "same"))
