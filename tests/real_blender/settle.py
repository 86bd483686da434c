# SPDX-License-Identifier: GPL-3.0-or-later
"""Say that all kernels are compiled: else windows compile, beside what is tested, those that no test here needs."""

import importlib

importlib.import_module("bl_ext.user_default.infrared_photons.compiling.compilation").write_mark()
