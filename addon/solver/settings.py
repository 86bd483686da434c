# SPDX-License-Identifier: GPL-3.0-or-later
"""How to render: passes, photons, stop conditions and the choices of the estimator."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass

from .physics.correction import Correction


@dataclass(frozen=True)
class Settings:
    """Settings of one render.

    passes: number of passes; 0 is no limit (then time_limit or target_noise must stop the render).
    photons_per_pass: photons emitted in each pass.
    neighbours: photons in one radiance estimate (k).
    seed: of all random numbers; a pass is a function of (seed, pass index) alone.
    threads: 0 uses every core. The image does not depend on it.
    pass_offset: index of the first pass, to go on with a render or to share it between machines.
    time_limit: s, 0 is none. target_noise: K, 0 is none; stops when the 95th percentile of Noise is below it.
    reference_subtraction: trace only the difference to an isothermal scene (docs/method.md).
    reference_temperature: K, None chooses it from the scene.
    roulette: 'POWER' keeps a photon's total weight; 'BAND_AVERAGE' is Boudet et al. 2004, section 3.2.
    shrink: let the gather radius shrink from pass to pass (Knaus and Zwicker 2011), so that the blur vanishes.
    assumed_emissivity, air_transmission, optics_transmission: above 0, at most 1. reflected_temperature,
        air_temperature, optics_temperature: K. All are of the film's Correction and change no pass.
    """

    passes: int = 32
    photons_per_pass: int = 100_000
    neighbours: int = 50
    seed: int = 0
    threads: int = 0
    pass_offset: int = 0
    time_limit: float = 0.0
    target_noise: float = 0.0
    reference_subtraction: bool = True
    reference_temperature: float | None = None
    roulette: str = "POWER"
    shrink: bool = True
    assumed_emissivity: float = 1.0
    reflected_temperature: float = 293.15
    air_transmission: float = 1.0
    air_temperature: float = 293.15
    optics_transmission: float = 1.0
    optics_temperature: float = 293.15

    @property
    def workers(self) -> int:
        """Threads to start."""
        return self.threads or os.cpu_count() or 1

    def __post_init__(self):
        for name, least in (
            ("passes", 0),
            ("photons_per_pass", 1),
            ("neighbours", 2),
            ("threads", 0),
            ("pass_offset", 0),
        ):
            if getattr(self, name) < least:
                raise ValueError(f"{name} is {getattr(self, name)}, at least {least} is needed")
        temperatures = ("reference_temperature", "reflected_temperature", "air_temperature", "optics_temperature")
        for name in ("time_limit", "target_noise", *temperatures):
            value = getattr(self, name)
            if value is not None and not 0 <= value < math.inf:
                raise ValueError(f"{name} is {value:g}, expected a finite number of 0 or more")
        if not 0 <= self.seed < 2**63:
            raise ValueError(f"seed is {self.seed}, expected 0 to 2^63 - 1")
        if self.passes == 0 and self.time_limit <= 0 and self.target_noise <= 0:
            raise ValueError("Nothing stops this render: set passes, time_limit or target_noise")
        for name in ("assumed_emissivity", "air_transmission", "optics_transmission"):
            if not 0 < getattr(self, name) <= 1:
                raise ValueError(f"{name} is {getattr(self, name):g}, expected above 0 to 1")
        if self.roulette not in ("POWER", "BAND_AVERAGE"):
            raise ValueError(f"roulette is '{self.roulette}', expected 'POWER' or 'BAND_AVERAGE'")

    @property
    def correction(self) -> Correction:
        """The Correction of the temperatures that a film of these settings gives."""
        further = Correction._fields[1:]
        return Correction(self.assumed_emissivity, *(getattr(self, name) for name in further))
