# SPDX-License-Identifier: GPL-3.0-or-later
"""The pages, their pictures and example scenes; what makes them is in `docs.tools`."""
