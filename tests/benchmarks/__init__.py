# SPDX-License-Identifier: GPL-3.0-or-later
"""Benchmarks, run by hand: python -m tests.benchmarks.speed_vs_error, and so on."""
