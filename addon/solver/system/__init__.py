# SPDX-License-Identifier: GPL-3.0-or-later
"""What the kernels stand on: how they are compiled and kept, and files that are either whole or not there."""
