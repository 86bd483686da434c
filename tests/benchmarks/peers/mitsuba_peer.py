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


class _BothSides(mi.Emitter):
    """As `area`, but both sides shine, so that a sheet needs no twin, and points are drawn evenly over the area,
    whatever the image of radiances has where: it may be negative, and wrapped around the surface more than once."""

    def __init__(self, properties):
        mi.Emitter.__init__(self, properties)
        self.radiance = properties["radiance"]
        self.m_flags = int(mi.EmitterFlags.Surface | mi.EmitterFlags.SpatiallyVarying)

    def eval(self, si, active=True):
        return dr.select(active, self.radiance.eval(si, active), 0.0)

    def sample_direction(self, it, sample, active=True):
        ds = self.get_shape().sample_direction(it, sample, active)
        active &= ds.pdf > 0.0
        si = mi.SurfaceInteraction3f(ds, it.wavelengths)
        ds.emitter = mi.EmitterPtr(self)
        return ds, dr.select(active, self.radiance.eval(si, active) / ds.pdf, 0.0)

    def pdf_direction(self, it, ds, active=True):
        return dr.select(active, self.get_shape().pdf_direction(it, ds, active), 0.0)

    def eval_direction(self, it, ds, active=True):
        return self.eval(mi.SurfaceInteraction3f(ds, it.wavelengths), active)

    def to_string(self):
        return "BothSides"


mi.register_emitter("both_sides", _BothSides)


def load(variant, problem, threads, clock):
    return _Mitsuba(variant, problem, threads, clock)


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


def _medium(gas):
    """Medium of the gas, and the integrator that it needs."""
    if gas.emits:
        raise ValueError("Mitsuba has no gas that emits; take away its temperature, if it has one")
    scale = gas.extinction.max()  # colours are at most 1
    extinction = gas.extinction / scale
    grey = np.ptp(extinction) == 0.0
    medium = {
        "type": "homogeneous",
        "albedo": _rgb(gas.scattering / np.where(extinction > 0.0, gas.extinction, 1.0)),
        "sigma_t": float(extinction[0]) if grey else _rgb(extinction),
        "scale": float(scale),
        "phase": {"type": "hg", "g": float(gas.anisotropy)},
    }
    if gas.density is not None:
        cells = gas.density[..., None] * (extinction[:1] if grey else extinction)
        to_world = gas.matrix @ np.diag([*gas.density.shape, 1.0])
        medium |= {
            "type": "heterogeneous",
            "sigma_t": {
                "type": "gridvolume",
                "grid": mi.VolumeGrid(np.ascontiguousarray(cells.transpose(2, 1, 0, 3), np.float32)),
                "filter_type": "nearest",
                "raw": True,
                "to_world": mi.ScalarTransform4f(to_world.tolist()),
            },
        }
    return mi.load_dict(medium), "volpath" if grey else "volpathmis"


def _mesh(name, vertices, triangles, properties, **of_vertices):
    """of_vertices: normals (n, 3) and texcoords (n, 2), both or none or the latter alone."""
    mesh = mi.Mesh(name, len(vertices), len(triangles), properties, "normals" in of_vertices, bool(of_vertices))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = vertices.ravel().astype(np.float32)
    parameters["faces"] = triangles.ravel()
    for kind, values in of_vertices.items():
        parameters[f"vertex_{kind}"] = values.ravel().astype(np.float32)
    parameters.update()
    return mesh


def _image(values, wrap):
    """Texture of values (h, w, channels), constant over each texel; row 0 is at v = 0."""
    tensor = mi.TensorXf(np.ascontiguousarray(values, np.float32))
    return mi.load_dict({"type": "bitmap", "data": tensor, "raw": True, "filter_type": "nearest", "wrap_mode": wrap})


def _skin_bsdf(skin):
    """The first surface, blended with the second by an image; with one that lets all pass, the image cuts holes."""
    opacity = 1.0 - skin.transmittance
    each = [
        {"type": "twosided", "nested": _bsdf(reflectance / max(share, 1e-9), *lobes)}
        for reflectance, share, lobes in zip(skin.reflectance, opacity, skin.lobes, strict=True)
    ]
    first, second = (
        one if share == 1.0 else {"type": "mask", "opacity": float(share), "nested": one}
        for one, share in zip(each, opacity, strict=True)
    )
    if not skin.share.any():
        return first
    if opacity[1] == 0.0:
        holes = _image(opacity[0] * (1.0 - skin.share[..., None]), skin.wrap)
        return {"type": "mask", "opacity": holes, "nested": each[0]}
    return {"type": "blendbsdf", "weight": _image(skin.share[..., None], skin.wrap), "first": first, "second": second}


def _skin_mesh(name, skin):
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(_skin_bsdf(skin))
    if np.any(skin.emission):
        emission = _image(skin.emission, skin.wrap)
        properties["emitter"] = mi.load_dict({"type": "both_sides", "radiance": emission})
    of_vertices = {} if skin.normals is None else {"normals": skin.normals.reshape(-1, 3)}
    triangles = np.arange(3 * len(skin.corners), dtype=np.uint32).reshape(-1, 3)
    vertices, texcoords = skin.corners.reshape(-1, 3), skin.uv.reshape(-1, 2)
    return _mesh(name, vertices, triangles, properties, texcoords=texcoords, **of_vertices)


def _emitter(radiance, both_sides):
    """Sheets shine from both sides. Of twins a hair apart the camera would see the gap, which is black."""
    if both_sides:
        return {"type": "both_sides", "radiance": _image(np.reshape(radiance, (1, 1, 3)), "repeat")}
    return {"type": "area", "radiance": _rgb(radiance)}


def _sky(radiance):
    """Its local y is up, and its image starts at -z, which looks along -x of the world, where ours starts."""
    turned = mi.ScalarTransform4f([[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    bitmap = mi.Bitmap(np.ascontiguousarray(radiance, np.float32))
    return {"type": "envmap", "bitmap": bitmap, "to_world": turned}


class _Mitsuba:
    def __init__(self, variant, problem, threads, clock):
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
                "near_clip": 1e-6,
                "to_world": mi.ScalarTransform4f().look_at(list(position), list(ahead), list(up)),
                "film": film,
                "sampler": {"type": "multijitter"},
            },
        }
        if problem.sky is not None:
            scene["world"] = _sky(problem.sky)
        elif np.any(problem.world):
            scene["world"] = {"type": "constant", "radiance": _rgb(problem.world)}
        elif problem.skins:  # else paths that pass through sheets and leave the scene count as if they had met nothing
            scene["world"] = {"type": "constant", "radiance": _rgb(problem.world), "sampling_weight": 0.0}
        sheets = set(problem.part[len(problem.part) - problem.twins :])
        for part, vertices, triangles in problem.meshes(twins=False):
            lobes = (problem.mirror[part], 0.0) if problem.lobes is None else problem.lobes[part]
            properties = mi.Properties()
            properties["bsdf"] = mi.load_dict({"type": "twosided", "nested": _bsdf(problem.reflectance[part], *lobes)})
            if np.any(problem.emission[part]):
                properties["emitter"] = mi.load_dict(_emitter(problem.emission[part], part in sheets))
            scene[f"part{part}"] = _mesh(f"part{part}", vertices, triangles, properties)
        for i, skin in enumerate(problem.skins):
            scene[f"skin{i}"] = _skin_mesh(f"skin{i}", skin)
        if problem.gas is not None:
            self._fill(scene, problem.gas)
        self.scene = mi.load_dict(scene)
        self.compiled = set()

    def _fill(self, scene, gas):
        medium, scene["integrator"]["type"] = _medium(gas)
        if gas.world:
            scene["sensor"]["medium"] = medium
            return
        properties = mi.Properties()
        properties["bsdf"] = mi.load_dict({"type": "null"})
        properties["interior"] = medium
        scene["gas"] = _mesh("gas", gas.vertices, gas.triangles, properties)

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
