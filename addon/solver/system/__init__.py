# SPDX-License-Identifier: GPL-3.0-or-later
"""System: how kernels are compiled and kept, and files that are either whole or not there."""
