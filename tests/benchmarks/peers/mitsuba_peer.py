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


class _Rough(mi.BSDF):
    """GGX lobe of a metal without Fresnel's factor, whose facets shadow each other by Smith's height-correlated formula
    (Heitz 2014), as ours do; Mitsuba's `roughconductor` takes both directions as independent."""

    def __init__(self, properties):
        mi.BSDF.__init__(self, properties)
        self.reflectance = mi.Color3f([float(properties[name]) for name in "rgb"])
        self.alpha = float(properties["alpha"])
        self.facets = mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.alpha, True)
        self.m_components = [mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.FrontSide]
        self.m_flags = self.m_components[0]

    def _smith(self, w):
        """Smith's Lambda."""
        return 0.5 * (dr.sqrt(1.0 + self.alpha**2 * mi.Frame3f.tan_theta_2(w)) - 1.0)

    def _half(self, wi, wo):
        return dr.normalize(wi + wo)

    def sample(self, context, si, sample1, sample2, active):
        facet, density = self.facets.sample(si.wi, sample2)
        bs = mi.BSDFSample3f()
        bs.wo = mi.reflect(si.wi, facet)
        bs.pdf = density / (4.0 * dr.dot(bs.wo, facet))
        bs.eta = 1.0
        bs.sampled_component = 0
        bs.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
        active &= (mi.Frame3f.cos_theta(si.wi) > 0) & (mi.Frame3f.cos_theta(bs.wo) > 0) & (bs.pdf > 0)
        before, after = self._smith(si.wi), self._smith(bs.wo)
        weight = (1.0 + before) / (1.0 + before + after)
        return bs, dr.select(active, self.reflectance * weight, 0.0)

    def eval(self, context, si, wo, active):
        cosine = mi.Frame3f.cos_theta(si.wi)
        active &= (cosine > 0) & (mi.Frame3f.cos_theta(wo) > 0)
        shadowing = 1.0 / (1.0 + self._smith(si.wi) + self._smith(wo))
        density = self.facets.eval(self._half(si.wi, wo))
        return dr.select(active, self.reflectance * density * shadowing / (4.0 * cosine), 0.0)

    def pdf(self, context, si, wo, active):
        active &= (mi.Frame3f.cos_theta(si.wi) > 0) & (mi.Frame3f.cos_theta(wo) > 0)
        facet = self._half(si.wi, wo)
        return dr.select(active, self.facets.pdf(si.wi, facet) / (4.0 * dr.dot(wo, facet)), 0.0)

    def eval_pdf(self, context, si, wo, active):
        return self.eval(context, si, wo, active), self.pdf(context, si, wo, active)

    def to_string(self):
        return f"Rough[alpha={self.alpha}]"


mi.register_bsdf("rough", _Rough)


def load(variant, problem, emission, reflectance, world, threads, clock):
    return _Mitsuba(variant, problem, emission, reflectance, world, threads, clock)


def _rgb(values):
    return {"type": "rgb", "value": [float(v) for v in values]}


def _bsdf(reflectance, specular, alpha):
    """Diffuse, specular, or a share of each; a lobe of this alpha, or a mirror."""
    diffuse = {"type": "diffuse", "reflectance": _rgb(reflectance)}
    if specular == 0.0:
        return diffuse
    sharp = {"type": "conductor", "material": "none", "specular_reflectance": _rgb(reflectance)}
    if alpha > 0.0:
        sharp = {"type": "rough", "alpha": float(alpha), **dict(zip("rgb", map(float, reflectance), strict=True))}
    if specular == 1.0:
        return sharp
    return {"type": "blendbsdf", "weight": float(specular), "diffuse": diffuse, "sharp": sharp}


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
            lobes = (problem.mirror[part], 0.0) if problem.lobes is None else problem.lobes[part]
            properties = mi.Properties()
            properties["bsdf"] = mi.load_dict({"type": "twosided", "nested": _bsdf(reflectance[part], *lobes)})
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
