# SPDX-License-Identifier: GPL-3.0-or-later
"""What cut-outs cost: a tree of leaf cards, whose outline is an image, against the same tree as meshes.

python -m tests.benchmarks.leaf_tree [--leaves 20000] [--passes 8]

Prints triangles, seconds of preparation and of a pass, of both trees in one run, and how far their pictures are apart,
in standard errors of the mean over blocks.
"""

import argparse
import dataclasses
import time

import numpy as np

from addon.solver import Material, Settings, SunLight, Texture, Textures, render
from tests.helpers.scenes import cylinder, join, look, make_scene, quad

EDGES = np.linspace(7.5, 14.0, 9)
NOTHING = Material("nothing", 0.0, transmittance=1.0)
LEAF, BARK, GROUND = Material("leaf", 0.96), Material("bark", 0.94), Material("ground", 0.92)
_CORNERS = 12  # of a leaf as a mesh
_TEXELS = 128  # along an edge of the card's mask


def main():
    """Render both trees."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--leaves", type=int, default=20_000)
    parser.add_argument("--passes", type=int, default=8)
    options = parser.parse_args()
    found = {}
    for name, build in (("meshes", as_meshes), ("cards", as_cards)):
        scene, sums, times = build(options.leaves), [], []
        started = time.monotonic()

        def keep(film, sums=sums, times=times):
            sums.append(film.passes * _blocks(film.bands().sum(axis=0)))
            times.append(time.monotonic())

        render(scene, Settings(passes=options.passes, photons_per_pass=30_000, threads=1), keep)
        found[name] = np.diff([np.zeros_like(sums[0]), *sums], axis=0), np.diff(times).mean()
        print(f"{name}: {len(scene.triangles)} triangles, {times[0] - started:.1f} s up to the first pass, "
              f"{found[name][1]:.3f} s a pass", flush=True)  # fmt: skip
    (meshes, seconds), (cards, with_cards) = found["meshes"], found["cards"]
    error = np.sqrt(sum(each.var(axis=0, ddof=1) / len(each) for each in (meshes, cards)))
    noisy = error > 0.0  # elsewhere there is but sky
    apart = ((cards.mean(axis=0) - meshes.mean(axis=0))[noisy] / error[noisy]).ravel()
    print(
        f"cards / meshes: time of a pass {with_cards / seconds:.2f}; {noisy.sum()} blocks are apart by "
        f"{np.sqrt(np.mean(apart**2)):.2f} standard errors rms"
    )


def as_meshes(leaves):
    """The tree whose leaves are polygons, each the outline of the mask."""
    centre, along, across = _leaves(leaves)
    angle = 2.0 * np.pi * np.arange(_CORNERS) / _CORNERS
    points = centre[:, None] + np.cos(angle)[:, None] * along[:, None] + np.sin(angle)[:, None] * across[:, None]
    fan = np.column_stack((np.zeros(_CORNERS - 2, int), np.arange(1, _CORNERS - 1), np.arange(2, _CORNERS)))
    triangles = (fan[None] + _CORNERS * np.arange(leaves)[:, None, None]).reshape(-1, 3)
    return _tree((points.reshape(-1, 3), triangles))


def as_cards(leaves):
    """The tree whose leaves are cards of two triangles with a mask."""
    centre, along, across = _leaves(leaves)
    points = np.stack([centre + i * along + j * across for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))], axis=1)
    triangles = (np.array([(0, 1, 2), (0, 2, 3)]) + 4 * np.arange(leaves)[:, None, None]).reshape(-1, 3)
    scene = _tree((points.reshape(-1, 3), triangles))
    count = 2 * leaves
    uv = np.tile(np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]], np.float32), (leaves, 1, 1))
    none = np.full(count, -1, np.int32)
    textures = Textures(
        np.arange(count, dtype=np.int32), uv, none, np.full(count, 3, np.int32), np.zeros((count, 3), np.float32),
        np.zeros(count, np.int32), (Texture(_mask(), "CLIP", True),),
    )  # fmt: skip
    return dataclasses.replace(scene, textures=textures)


def _mask():
    """1 outside of the polygon that is a leaf, 0 inside."""
    x, y = np.meshgrid(*2 * ((np.arange(_TEXELS) + 0.5) / _TEXELS * 2.0 - 1.0,))
    middle = 2.0 * np.pi * (np.arange(_CORNERS) + 0.5) / _CORNERS
    inside = np.all([x * np.cos(m) + y * np.sin(m) <= np.cos(np.pi / _CORNERS) for m in middle], axis=0)
    return (~inside).astype(np.float32)


def _leaves(count):
    """Centres (n, 3) of leaves in a crown, and the half axes of each."""
    random = np.random.default_rng(1)
    way = random.normal(size=(count, 3))
    centre = (0, 0, 3.5) + 1.8 * way / np.linalg.norm(way, axis=1, keepdims=True) * random.random((count, 1)) ** (1 / 3)
    along = random.normal(size=(count, 3))
    along *= 0.06 / np.linalg.norm(along, axis=1, keepdims=True)
    across = np.cross(along, random.normal(size=(count, 3)))
    across *= 0.03 / np.linalg.norm(across, axis=1, keepdims=True)
    return centre, along, across


def _tree(leaves):
    """Leaves (vertices, triangles) on a trunk, over warm ground, under a cold sky and a sun."""
    trunk, bark = cylinder(12, 0.12, 3.0)
    ground = quad((0, 0, 0), (15, 0, 0), (0, 15, 0))
    *mesh, index = join((*leaves, 299.0, 0), (trunk, bark, 303.0, 1), (*ground, 308.0, 2))
    camera = look((6, -6, 2.5), (0, 0, 2.6), 128, 96, tangent=0.45)
    materials = [LEAF, BARK, GROUND, NOTHING]
    sun = SunLight(np.array((0.4, 0.3, -1.0)), 700.0)
    return make_scene(*mesh, materials, camera, EDGES, index, world_temperature=265.0, lights=(sun,))


def _blocks(image):
    height, width = image.shape
    return image.reshape(height // 8, 8, width // 8, 8).mean(axis=(1, 3), dtype=float)


if __name__ == "__main__":
    main()
