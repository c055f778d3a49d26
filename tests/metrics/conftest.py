"""Lets these tests import the reference evaluators beside them (``oracles``); no time limits on property tests."""

import sys
from pathlib import Path

from hypothesis import settings

sys.path.insert(0, str(Path(__file__).parents[1]))
settings.register_profile("metrics", deadline=None, max_examples=30)
settings.load_profile("metrics")
