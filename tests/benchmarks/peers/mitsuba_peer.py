# SPDX-License-Identifier: GPL-3.0-or-later
"""Mitsuba 3, variant llvm_ad_rgb, integrator `path`: no limit of depth, box filter of a pixel, no clamping.

Of its samplers multijitter reaches an error in about half the time of the default. Negative emission is welcome: all
of it is linear.
"""

import glob
import os

import numpy as np

if "DRJIT_LIBLLVM_PATH" not in os.environ:
    for _path in glob.glob("/usr/lib/*/libLLVM*.so*"):
        if "19" in _path:
            os.environ["DRJIT_LIBLLVM_PATH"] = _path

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

mi.set_variant("llvm_ad_rgb")
_CHUNK = 256  # samples of a pixel in one launch: more need more memory and are no faster


def load(variant, problem, emission, reflectance, world, threads, clock):
    return _Mitsuba(variant, problem, emission, reflectance, world, threads, clock)


def _rgb(values):
    return {"type": "rgb", "value": [float(v) for v in values]}


class _Mitsuba:
    def __init__(self, variant, problem, emission, reflectance, world, threads, clock):
        self.clock = clock
        dr.set_thread_count(threads)
        position, ahead, up = problem.camera
        film = {
            "type": "hdrfilm",
            "width": int(problem.width),
            "height": int(problem.height),
            "rfilter": {"type": "box"},
            "pixel_format": "rgb",
            "component_format": "float32",
        }
        scene = {
            "type": "scene",
            "integrator": {"type": variant, "max_depth": -1},
            "sensor": {
                "type": "perspective",
                "fov": float(np.degrees(2 * np.arctan(problem.tangent))),
                "fov_axis": "x",
                "near_clip": 1e-3,
                "to_world": mi.ScalarTransform4f().look_at(list(position), list(ahead), list(up)),
                "film": film,
                "sampler": {"type": "multijitter"},
            },
        }
        if np.any(world):
            scene["world"] = {"type": "constant", "radiance": _rgb(world)}
        for part, vertices, triangles in problem.meshes():
            bsdf = {"type": "diffuse", "reflectance": _rgb(reflectance[part])}
            if problem.mirror[part]:
                bsdf = {"type": "conductor", "material": "none", "specular_reflectance": _rgb(reflectance[part])}
            properties = mi.Properties()
            properties["bsdf"] = mi.load_dict({"type": "twosided", "nested": bsdf})
            if np.any(emission[part]):
                properties["emitter"] = mi.load_dict({"type": "area", "radiance": _rgb(emission[part])})
            mesh = mi.Mesh(f"part{part}", len(vertices), len(triangles), properties)
            parameters = mi.traverse(mesh)
            parameters["vertex_positions"] = vertices.ravel()
            parameters["faces"] = triangles.ravel()
            parameters.update()
            scene[f"part{part}"] = mesh
        self.scene = mi.load_dict(scene)
        self.compiled = set()

    def render(self, samples, seed):
        """Mean image (height, width, 3) of about so many samples, row 0 the bottom, and the seconds it took."""
        chunks = [_CHUNK] * (samples // _CHUNK)
        rest = samples % _CHUNK
        if rest or not chunks:
            chunks.append(8 * round(rest / 8) if rest > 12 else 2 ** round(np.log2(rest)))  # multijitter wants a grid
        for chunk in set(chunks) - self.compiled:
            self._image(chunk, seed)
            self.compiled.add(chunk)
        started = self.clock()
        total = sum(chunk * self._image(chunk, seed * 1009 + i) for i, chunk in enumerate(chunks))
        return total[::-1] / sum(chunks), self.clock() - started

    def _image(self, samples, seed):
        return np.array(mi.render(self.scene, spp=samples, seed=seed & 0xFFFFFFFF), dtype=np.float64)

    def close(self):
        self.scene = None
