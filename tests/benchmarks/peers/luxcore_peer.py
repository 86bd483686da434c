# SPDX-License-Identifier: GPL-3.0-or-later
"""LuxCore, engines PATHCPU and BIDIRCPU: 64 bounces, no pixel filter, no clamping.

Its weights of multiple importance sampling leave out, where a path hits a light, the roulette that they count where it
samples one (seen in version 2.11, worth 1 to 5 % in a deep cavity), so roulette starts where next to no light is left.
Lights (triangles) are chosen uniformly: by power it is several times slower where everything emits.
Without a filter LuxCore puts every sample one row too low, so the film has a row more, which is cut off.
"""

import time

import numpy as np
import pyluxcore

_DEPTH = 64
_LITTLE = 1e-3  # share of the light that is left when roulette starts
pyluxcore.Init(lambda message: None)


def load(variant, problem, threads, clock):
    return _LuxCore(variant, problem, threads, clock)


class _LuxCore:
    def __init__(self, variant, problem, threads, clock):
        if problem.gas is not None:
            raise ValueError("LuxCore's gas is not compared: what it emits is not what it absorbs")
        self.clock = clock
        self.variant, self.threads = variant, threads
        self.width, self.height = int(problem.width), int(problem.height)
        position, ahead, up = (list(map(float, vector)) for vector in problem.camera)
        tangent = float(problem.tangent)
        vertical, row = tangent * self.height / self.width, 2 * tangent / self.width
        properties = {
            "scene.camera.type": "perspective",
            "scene.camera.lookat.orig": position,
            "scene.camera.lookat.target": ahead,
            "scene.camera.up": up,
            "scene.camera.fieldofview": 90.0,
            "scene.camera.screenwindow": [-tangent, tangent, -vertical - row, vertical],
            "scene.camera.cliphither": 1e-3,
        }
        if np.any(problem.world):
            properties |= {
                "scene.lights.world.type": "constantinfinite",
                "scene.lights.world.color": list(map(float, problem.world)),
                "scene.lights.world.visibilitymapcache.enable": False,
            }
        brightest = min(0.9, max(problem.reflectance[~problem.mirror].max(initial=0.0), 0.1))
        self.roulette_depth = int(np.ceil(np.log(_LITTLE) / np.log(brightest)))
        self.scene = pyluxcore.Scene()
        for part, vertices, triangles in problem.meshes():
            self.scene.DefineMesh(
                f"mesh{part}",
                [tuple(map(float, v)) for v in vertices],
                [tuple(map(int, t)) for t in triangles],
                None, None, None, None,
            )  # fmt: skip
            colour = list(map(float, problem.reflectance[part]))
            material = f"scene.materials.material{part}"
            if problem.mirror[part]:
                properties |= {f"{material}.type": "mirror", f"{material}.kr": colour}
            else:
                properties |= {f"{material}.type": "matte", f"{material}.kd": colour}
            if np.any(problem.emission[part]):
                properties[f"{material}.emission"] = list(map(float, problem.emission[part]))
            properties |= {
                f"scene.objects.object{part}.shape": f"mesh{part}",
                f"scene.objects.object{part}.material": f"material{part}",
            }
        self.scene.Parse(_properties(properties))

    def render(self, samples, seed):
        """Mean image (height, width, 3) of about so many samples, row 0 the bottom, and the seconds it took."""
        config = {
            "renderengine.type": self.variant,
            "renderengine.seed": seed % 2**30 + 1,
            "native.threads.count": self.threads,
            "sampler.type": "SOBOL",
            "sampler.sobol.adaptive.strength": 0.0,
            "film.width": self.width,
            "film.height": self.height + 1,
            "film.filter.type": "NONE",
            "film.outputs.0.type": "RGB",
            "film.outputs.0.filename": "unused.exr",
            "path.pathdepth.total": _DEPTH,
            "path.pathdepth.diffuse": _DEPTH,
            "path.pathdepth.glossy": _DEPTH,
            "path.pathdepth.specular": _DEPTH,
            "path.maxdepth": _DEPTH,
            "light.maxdepth": _DEPTH,
            "path.russianroulette.depth": self.roulette_depth,
            "lightstrategy.type": "UNIFORM",
            "path.clamping.variance.maxvalue": 0.0,
            "batch.haltspp": int(samples),
        }
        session = pyluxcore.RenderSession(pyluxcore.RenderConfig(_properties(config), self.scene))
        session.Start()
        started = self.clock()
        while not session.HasDone():
            time.sleep(0.002)
            session.UpdateStats()
        spent = self.clock() - started
        image = np.empty((self.height + 1, self.width, 3), np.float32)
        session.GetFilm().GetOutputFloat(pyluxcore.FilmOutputType.RGB, image, 0)
        session.Stop()
        return image[:-1].astype(np.float64), spent * self.height / (self.height + 1)

    def close(self):
        self.scene = None


def _properties(values):
    properties = pyluxcore.Properties()
    for key, value in values.items():
        properties.Set(pyluxcore.Property(key, value))
    return properties
