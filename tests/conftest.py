"""Property tests draw the same examples in every run; with `--hypothesis-profile explore`, they draw new examples.

In CI, no test may be skipped.
"""

import os

import pytest
from hypothesis import settings

settings.register_profile("same-every-time", derandomize=True, deadline=None, database=None, max_examples=40)
settings.register_profile("all-day", deadline=None, max_examples=7000)
settings.register_profile("explore", deadline=None, max_examples=1000)
settings.load_profile("same-every-time")


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Let a run with CI=true fail if a test was skipped, because a package that `make test` installs is then missing."""
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    if reporter is None or os.environ.get("CI") != "true":
        return
    skipped = reporter.stats.get("skipped", [])
    if skipped and session.exitstatus == 0:
        session.exitstatus = 1
        reporter.write_line(f"CI: {len(skipped)} skipped, where none may be", red=True)
