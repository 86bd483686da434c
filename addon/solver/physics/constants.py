# SPDX-License-Identifier: GPL-3.0-or-later
"""Constants of radiation (CODATA 2018): h, c and k are exact, so what follows from them is rounded only by float64."""

_H, _C, _K = 6.62607015e-34, 299792458.0, 1.380649e-23
C1 = 2.0 * _H * _C**2 * 1e24  # 2 h c^2 in W um^4 m^-2 sr^-1
C2 = _H * _C / _K * 1e6  # h c / k in um K
SIGMA = 5.670374419e-8  # Stefan-Boltzmann constant, W m-2 K-4
