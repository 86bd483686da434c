# SPDX-License-Identifier: GPL-3.0-or-later
"""The facts that every file states beside its images: units, bands, responses, what temperatures mean and how it was
rendered.

Each writer stores the same facts in its own format's way, so what is added here is in every file.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..solver.physics.spectrum import C1, C2
from ..version import version

BAND_UNIT = "W m-2 sr-1 um-1"
# Name of a fact -> field of the solver's Correction. Older files lack the last four.
CORRECTION_FACTS = {
    "assumedEmissivity": "emissivity",
    "reflectedTemperature": "reflected_temperature",  # K
    "airTransmission": "air_transmission",
    "airTemperature": "air_temperature",  # K
    "opticsTransmission": "optics_transmission",
    "opticsTemperature": "optics_temperature",  # K
}


def how_rendered(film, settings) -> dict[str, object]:
    """The settings that made an image, by the names that files give them, from the solver's Film and Settings."""
    return {
        "software": f"Infrared Photons {version()}",
        "passes": film.passes,
        "firstPass": settings.pass_offset,
        "photons": film.photons,
        "photonsPerPass": settings.photons_per_pass,
        "neighbours": settings.neighbours,
        "seed": settings.seed,
        "shrinkingRadius": settings.shrink,
        "roulette": settings.roulette,
        "referenceSubtraction": settings.reference_subtraction,
        "referenceTemperature": film.reference_temperature,  # K
        "bandWeights": " ".join(str(float(weight)) for weight in film.weights),
        **{fact: getattr(settings.correction, field) for fact, field in CORRECTION_FACTS.items()},
        "timeLimit": settings.time_limit,  # s
        "targetNoise": settings.target_noise,  # K
    }


def describe(units: str, band_edges: np.ndarray, metadata: Mapping[str, object]) -> dict[str, str]:
    """All facts of a file as text by name, ASCII without line breaks. Numbers have every digit of float64.

    units: of the images in this file. band_edges: (b + 1,) um. metadata: more facts by name, see `how_rendered`.
    """
    edges = [str(float(edge)) for edge in band_edges]
    facts = {
        "units": f"{units}; bandEdges, wavelengthRange: um; timeLimit: s; "
        "referenceTemperature, reflectedTemperature, airTemperature, opticsTemperature, targetNoise: K",
        "bandEdges": " ".join(edges),
        "wavelengthRange": f"{edges[0]} {edges[-1]}",
        "response": "1 from the lower to the upper edge of each band, 0 outside; Radiance is the integral of all "
        "bands, each times the sensor's response in it (bandWeights)",
        "temperatureCalibration": "Temperature is that of the blackbody with the radiance (Radiance - "
        "opticsTransmission * airTransmission * (1 - assumedEmissivity) * Radiance of a blackbody at "
        "reflectedTemperature - opticsTransmission * (1 - airTransmission) * that at airTemperature - "
        "(1 - opticsTransmission) * that at opticsTemperature) / (opticsTransmission * airTransmission * "
        f"assumedEmissivity), with the same bandWeights, from {edges[0]} to {edges[-1]} um, by Planck's law with 2hc2 "
        f"{C1} W um4 m-2 sr-1 and hc/k {C2} um K",
    }
    return facts | {name: str(value) for name, value in metadata.items()}
