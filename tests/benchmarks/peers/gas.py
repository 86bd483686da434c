# SPDX-License-Identifier: GPL-3.0-or-later
"""The gas of a scene as any renderer can take it: coefficients and radiances in numbers."""

from dataclasses import dataclass, fields, replace

import numpy as np

_PREFIX = "gas_"  # of its arrays beside those of the surfaces
_AROUND = 0.01  # of the scene's size: so far beyond it reaches the box that holds the gas of the world


@dataclass
class Gas:
    """One gas, arrays only, in B bands or in three.

    absorption and scattering (B,) 1/m, where the density is 1; anisotropy of Henyey and Greenstein. source: (B,) or,
    cell by cell, (B, i, j, k), radiance of a blackbody at its temperature over that at the reference, W m-2 sr-1.
    vertices (n, 3) m and triangles (m, 3) of the closed mesh that holds it. world: whether it is everywhere, around the
    camera, too; the mesh is then a box around all. density (i, j, k), constant in cells, and matrix (4, 4) from these
    to the world, m; None where it is 1 in all of the mesh.
    """

    absorption: np.ndarray
    scattering: np.ndarray
    anisotropy: float
    source: np.ndarray
    vertices: np.ndarray
    triangles: np.ndarray
    world: bool
    density: np.ndarray | None = None
    matrix: np.ndarray | None = None

    def arrays(self) -> dict[str, np.ndarray]:
        """By the names that a file of a whole problem gives them."""
        named = {_PREFIX + field.name: getattr(self, field.name) for field in fields(self)}
        return {name: array for name, array in named.items() if array is not None}

    @classmethod
    def from_arrays(cls, named: dict[str, np.ndarray]) -> "Gas | None":
        """Takes its arrays out of those of a whole problem; None if there are none."""
        own = {name: named.pop(name) for name in list(named) if name.startswith(_PREFIX)}
        return cls(**{name.removeprefix(_PREFIX): array for name, array in own.items()}) if own else None

    @property
    def extinction(self) -> np.ndarray:
        return self.absorption + self.scattering

    @property
    def emits(self) -> bool:
        return bool(np.any(self.source) and np.any(self.absorption))

    def brightest(self) -> np.ndarray:
        """(B,) the largest magnitude of the source."""
        return np.abs(self.source).reshape(len(self.source), -1).max(axis=1)

    def of_bands(self, bands: list[int], scale: np.ndarray) -> "Gas":
        """Its bands of this index, with the source in units of the scale (b,)."""
        source = (self.source[bands].T / scale).T
        return replace(self, absorption=self.absorption[bands], scattering=self.scattering[bands], source=source)


def build_gas(scene, black: np.ndarray) -> Gas | None:
    """The gas of a scene; black: (B,) radiance of the reference."""
    from addon.solver.physics.media import band_anisotropy, band_coefficient
    from addon.solver.physics.spectrum import band_radiance

    if not scene.media:
        return None
    medium, edges = scene.media[0], scene.band_edges
    anisotropy = band_anisotropy(medium, edges)
    if len(scene.media) > 1 or medium.typical_gas or np.ptp(anisotropy) > 0.0:
        raise ValueError("Peers take one gas, without species, and one anisotropy for all bands")
    density, temperature, matrix = (None, medium.temperature, None) if medium.grid is None else _cells(medium)
    source = np.moveaxis(band_radiance(edges, temperature) - black, -1, 0)
    return Gas(
        band_coefficient(medium, "absorption", edges),
        band_coefficient(medium, "scattering", edges),
        float(anisotropy[0]),
        source if source.ndim == 1 else source.astype(np.float32) * (density > 0.0),
        *_outline(scene, medium, density, matrix),
        medium.outline is None,
        density,
        matrix,
    )


def _cells(medium):
    """Density (i, j, k) and temperature, one or (i, j, k), of a grid, and the matrix from their cells to the world."""
    from addon.solver.scene import LEAF

    grid = medium.grid
    low, count = grid.box

    def dense(values):
        array = np.zeros((*count, LEAF, LEAF, LEAF), np.float32)
        array[tuple((grid.leaves - low).T)] = values
        return array.transpose(0, 3, 1, 4, 2, 5).reshape(LEAF * count)

    density = dense(1.0 if grid.density is None else grid.density)
    temperature = medium.temperature if grid.temperature is None else dense(grid.temperature)
    matrix = grid.matrix
    matrix[:3, 3] += matrix[:3, :3] @ (LEAF * low)
    return density, temperature, matrix


def _outline(scene, medium, density, matrix):
    """Vertices and triangles, their fronts outside, of the closed mesh that holds the medium."""
    from addon.solver.geometry.closed import outward
    from tests.helpers.scenes import box

    if medium.triangles is not None:
        corners = outward(np.asarray(medium.vertices, float)[medium.triangles])
        vertices, triangles = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
        return vertices, triangles.reshape(-1, 3).astype(np.int32)
    vertices, triangles = box()
    if density is not None:
        vertices = vertices * density.shape @ matrix[:3, :3].T + matrix[:3, 3]
        return vertices, triangles if np.linalg.det(matrix) > 0.0 else triangles[:, ::-1]
    inside = np.vstack((scene.vertices, scene.camera.matrix[:3, 3]))
    low, high = inside.min(axis=0), inside.max(axis=0)
    margin = _AROUND * (high - low).max()
    return low - margin + vertices * (high - low + 2.0 * margin), triangles
