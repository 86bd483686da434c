# SPDX-License-Identifier: GPL-3.0-or-later
"""The tests; what they share is in `tests.helpers`."""
