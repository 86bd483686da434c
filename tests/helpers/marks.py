# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of parametrised tests that are for --long alone."""

import pytest


def long(*values, **options):
    """pytest.param of the values, with its options, for a test that runs with --long alone."""
    return pytest.param(*values, marks=pytest.mark.long, **options)
