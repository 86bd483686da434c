# SPDX-License-Identifier: GPL-3.0-or-later
"""The survey: a few rays through every pixel tell, before the first pass, how much the radiance varies within the
pixel, how much its temperature depends on its radiance, and how noisy its final gathers are.

The survey has random numbers of its own, the same for every seed. So what is decided by it leaves the mean of the image
alone.
"""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..geometry.curved import reflecting
from ..geometry.eye import Eye, empty_eye_rays, eye_rays
from ..geometry.flight import NUMBERS
from ..geometry.interaction import emit_at, interact, leave
from ..geometry.segments import FROM_CAMERA, FROM_DIFFUSE, RayBatch, Tracer
from ..geometry.stage import Stage, emission_at, lobes_at, nothing_emitted, one_reflectance_at
from ..geometry.surfaces import sheet_of
from ..image.pooling import sum_around
from ..physics.fresnel import BELOW, FACET, in_one_band
from ..physics.lobes import (
    diffuse_density,
    diffuse_share,
    facet_cosine,
    follows_fresnel,
    is_glossy,
    is_specular,
    sample_diffuse,
    sample_specular,
)
from ..physics.sky import radiance_from
from ..physics.spectrum import apparent_temperature
from ..sampling.heuristics import ALONE, TYPICAL_RAYS
from ..sampling.rng import PILOT, SURVEY, pass_key, path_key, uniform
from ..sampling.vectors import vector
from ..system.kernels import INLINED, KERNEL, njit
from .lamps import share_of_ray, share_of_sky
from .media import Scattered, cross_samples
from .sheets import Excess, Sheets, drawn_means
from .specks import Specks, find_specks, variance_of_specks

_SAMPLES = 16  # samples of a pixel: camera rays that survey it
_BOUNCES = 8  # specular reflections, at most, through which a sample is followed
_FAINT = 1.0 / 64.0  # throughput below which a sample is not followed any further
_EDGE, _BLOCKS = 8, 4096  # least number of pixels on each side of a block; largest number of blocks
_TRIED = 256  # trial rays of final gathers in a block, for each number of bounces
_CHUNK = 1 << 10  # pixels that are surveyed as one piece of work
_STEP = 1e-3  # relative step of the radiance in the derivative of the temperature
_FAINTEST = 0.05  # least radiance of a pixel, over the mean of the image, in that derivative: at 0 K it is undefined
_AROUND = 1.0 / 16.0  # share of the variance of a pixel's neighbourhood that its own variance is taken to have at least
_PRIOR = 32.0  # trial rays that the mean over the whole sheet counts as in a cell: few rays of its own may miss much
_FEW = 4.0  # trial rays that the mean over all sheets counts as on a sheet, as many sheets, such as hairs, have none
_DIMENSION = 1 << 16  # first dimension of a sample's random numbers on surfaces, four for each bounce
_WALKING = _DIMENSION + 4 * (_BOUNCES + 1)  # of those in media; and those of trial rays:
_TRIAL_WALKING = _WALKING + NUMBERS * (_BOUNCES + 1)
_HEAD_ON = 1.0  # cosine at which emission is evaluated: the additional emission at grazing angles is left out


class Cells(NamedTuple):
    """Final gathers by cell (c,). A cell is one sheet in one block of pixels.

    key: int64, ascending, number of the block times number of sheets plus label of the sheet. brightness: radiance that
    rays from the cell meet, over the mean radiance that photons of the trial pass tell of the whole sheet. ray_noise:
    W2 sr-2 m-4, variance of the radiance that a single ray from the cell meets, including the variance of the recalled
    irradiance. met: W m-2 sr-1, mean of that radiance. closeness: 1 / m, mean of the inverse distance to what rays
    meet. density: 1 / m2, gathers of a pass. rest: W2 sr-2 m-4, variance that remains however many rays are sent, as
    the recalled irradiance comes from photons that all rays share, and as caustics do. count: number of gathers, one
    for each pixel and number of bounces at which the sheet is shown. contribution2: mean square of the gathers'
    contributions: the share of the pixel that the light reflected there makes up, times the pixel's sensitivity.
    """

    key: np.ndarray
    brightness: np.ndarray
    ray_noise: np.ndarray
    met: np.ndarray
    closeness: np.ndarray
    density: np.ndarray
    rest: np.ndarray
    count: np.ndarray
    contribution2: np.ndarray


class Survey(NamedTuple):
    """What the survey found, by pixel of the window (p,).

    sensitivity: float64, how much the apparent temperature depends on the radiance, with a mean square of 1. variance:
    float64, W2 sr-2 m-4, variance of the radiance that single camera rays see, times the squared sensitivity; but at
    least a sixteenth of the sum of these over the pixel and its eight neighbours. own: float64, W2 sr-2 m-4, the
    variance of what the pixel shows straight or in mirrors, 0 where chance has a part in it. specks: see Specks, with
    their contrast to what is around them for their radiance. unknown: bool, whether the pixel shows a rough lobe, of
    which a few samples do not say all, or a specular surface where a sample ended, as its throughput was small or after
    too many reflections. estimated: bool, whether it shows a surface whose reflected light has to be estimated. All
    else is seen exactly, but for edges. block: int32, number of the block that the pixel lies in. in_fog: whether there
    is gas that scatters.
    """

    sensitivity: np.ndarray
    variance: np.ndarray
    unknown: np.ndarray
    estimated: np.ndarray
    block: np.ndarray
    cells: Cells
    in_fog: bool
    own: np.ndarray
    specks: Specks


class _Samples(NamedTuple):
    """Rays of samples, from the camera, after specular reflections or scattered by media, or trial rays of gathers.

    origin, direction: (n, 3) float32. number: (n,) int64, number of the sample in its chunk. path: (n,) uint64, key of
    the sample's random numbers. throughput: (n,) float64, share of the radiance along the ray that reaches the camera.
    way: (n,) float64, m, length of the path from the camera to the origin. angle: (n,) float64, solid angle of the
    pixel, sr; for parallel rays its area, m2. density: (n,) float32, see Rays: rays of final gathers, and those that
    media scattered, leave a part of the light of lamps to shadow rays.
    """

    origin: np.ndarray
    direction: np.ndarray
    number: np.ndarray
    path: np.ndarray
    throughput: np.ndarray
    way: np.ndarray
    angle: np.ndarray
    density: np.ndarray


class _Shown(NamedTuple):
    """Diffusely reflecting surfaces that n samples show. sheet: int32, label, -1 for none. throughput: float64, share
    of the pixel that the light reflected there makes up, by this sample alone. footprint: float64, m2, area of the
    surface that the pixel covers."""

    sheet: np.ndarray
    throughput: np.ndarray
    footprint: np.ndarray


class _Gathers(NamedTuple):
    """n final gathers that pixels might send. pixel: int32. sheet: int32, label. throughput: float64, share of the
    pixel that the light reflected there makes up."""

    pixel: np.ndarray
    sheet: np.ndarray
    throughput: np.ndarray


class _Tried(NamedTuple):
    """n trial rays of final gathers.

    pixel, sheet: int32, the pixel and the label of the sheet that send the ray. The other fields are float64. met: W
    m-2 sr-1, radiance that the ray meets. bright: absolute value of met, 0 where no photons tell of that radiance.
    noise: W2 sr-2 m-4, variance of the radiance that the ray would recall. rest: W2 sr-2 m-4, variance, from recalled
    irradiance, of the mean over many rays from one point. closeness: 1 / m, inverse distance to what the ray meets.
    density: 1 / m2, of gathers.
    """

    pixel: np.ndarray
    sheet: np.ndarray
    met: np.ndarray
    bright: np.ndarray
    noise: np.ndarray
    closeness: np.ndarray
    density: np.ndarray
    rest: np.ndarray


class _Chunk(NamedTuple):
    """What the survey found of some pixels. pixels: their numbers. seen: (pixels, _SAMPLES) float64, radiance that each
    sample sees. unknown: (pixels,) bool. gathers, tried: lists, one entry for each number of bounces."""

    pixels: np.ndarray
    seen: np.ndarray
    unknown: np.ndarray
    gathers: list[_Gathers]
    tried: list[_Tried]


def survey_pixels(
    stage: Stage,
    tracer: Tracer,
    excess: Excess,
    sheets: Sheets,
    eye: Eye,
    edges: np.ndarray,
    threads: int,
    cancelled: Callable[[], bool],
) -> Survey:
    """Send samples through every pixel, and trial rays of the final gathers that the pixels might send.

    edges: (b + 1,) um, of the bands. cancelled: once it returns true, the result has no meaning.
    """
    x0, y0, x1, y1 = (int(end) for end in eye.window)
    width, height = x1 - x0, y1 - y0
    edge = _EDGE
    while -(-width // edge) * -(-height // edge) > _BLOCKS:
        edge += 1
    block = _blocks(width, height, edge)
    stride = max(1, round(_SAMPLES * len(block) / (_TRIED * (block[-1] + 1))))
    surveyor = _Surveyor(_in_one_band(stage), tracer, excess, sheets, eye, pass_key(0, SURVEY, PILOT), stride)

    def survey(first: int) -> _Chunk:
        return surveyor.survey(np.arange(first, first if cancelled() else min(first + _CHUNK, len(block))))

    mean, variance, unknown = np.zeros(len(block)), np.zeros(len(block)), np.zeros(len(block), np.bool_)
    gathers, tried = [], []
    with ThreadPoolExecutor(threads) as pool:
        for chunk in pool.map(survey, range(0, len(block), _CHUNK)):
            mean[chunk.pixels], variance[chunk.pixels] = chunk.seen.mean(axis=1), chunk.seen.var(axis=1, ddof=1)
            unknown[chunk.pixels] = chunk.unknown
            gathers += chunk.gathers
            tried += chunk.tried
    gathers = _Gathers(*map(np.concatenate, zip(*gathers, strict=True)))
    tried = _Tried(*map(np.concatenate, zip(*tried, strict=True)))
    sensitivity = _sensitivity(stage.radiometry.reference.sum() + mean, edges)
    cells = _cells(sheets, block, sensitivity, gathers, tried)
    specks = find_specks(stage, tracer, eye)
    specks = specks._replace(radiance=np.where(specks.share > 0.0, np.abs(specks.radiance - mean), 0.0))
    own = np.maximum(variance, variance_of_specks(specks, _SAMPLES))
    variance = own * sensitivity**2
    around = sum_around(variance.reshape(height, width), 1).ravel()
    estimated = unknown.copy()
    estimated[gathers.pixel] = True
    variance = np.maximum(variance, _AROUND * around)
    own[unknown | tracer.scatters] = 0.0
    return Survey(sensitivity, variance, unknown, estimated, block, cells, tracer.scatters, own, specks)


def _in_one_band(stage: Stage) -> Stage:
    """The stage with one column of reflectance, the mean over the bands, so that all bands are reflected alike."""
    mean = stage.radiometry.reflectance.mean(axis=1, keepdims=True)
    radiometry = stage.radiometry
    return stage._replace(radiometry=radiometry._replace(reflectance=mean, fresnel=in_one_band(radiometry.fresnel)))


@dataclass(frozen=True)
class _Surveyor:
    """Surveys pieces of the image, and holds what that needs.

    stage: see _in_one_band. key: of the samples. stride: one sample of so many sends a trial ray. The other fields: see
    survey_pixels.
    """

    stage: Stage
    tracer: Tracer
    excess: Excess
    sheets: Sheets
    eye: Eye
    key: np.uint64
    stride: int

    def survey(self, pixels: np.ndarray) -> _Chunk:
        """The _Chunk of some pixels (n,)."""
        samples, reach = _straight(self.eye, self.key, pixels)
        count = len(samples.number)
        seen, unclear = np.zeros(count), np.zeros(count, np.bool_)
        gathers, tried = [], []
        for bounce in range(_BOUNCES + 1):
            tracer = self.tracer.seen_from(FROM_DIFFUSE if bounce else FROM_CAMERA)
            hits = tracer.trace(samples.origin, samples.direction, reach)
            scattered = self._cross(hits, samples, _WALKING + NUMBERS * bounce, seen)
            seen[samples.number] += samples.throughput * self._see(hits, samples)
            shown = self._shown(hits, samples)
            tried.append(self._try_gathers(pixels, bounce, hits, samples, shown))
            gathers.append(_join_gathers(pixels, samples, shown))
            onward = _Samples(*map(np.empty_like, samples))
            sent = _follow(self.stage, bounce, hits, samples, unclear, onward)
            samples = _Samples(*(column[:sent] for column in onward))
            if scattered is not None:
                unclear[scattered.number] = True
                samples = _Samples(*map(np.concatenate, zip(samples, scattered, strict=True)))
            if len(samples.number) == 0:
                break
            reach = np.full(len(samples.number), 1e37, np.float32)
        shape = (len(pixels), _SAMPLES)
        return _Chunk(pixels, seen.reshape(shape), unclear.reshape(shape).any(axis=1), gathers, tried)

    def _cross(self, hits, rays, dimension, seen) -> _Samples | None:
        """What media scatter of rays, None without media; see cross_samples. seen: by number of the sample."""
        if not self.tracer.holds_media:
            return None
        glow = np.zeros(len(rays.number))
        batch, numbers = RayBatch(rays.origin, rays.direction), (rays.path, dimension)
        scattered = cross_samples(self.tracer, hits, batch, rays.throughput, numbers, glow)
        np.add.at(seen, rays.number, glow)
        return _go_astray(rays, scattered)

    def _see(self, hits, rays) -> np.ndarray:
        """(n,) excess radiance of all bands, W m-2 sr-1, that rays see."""
        mean = self.excess.surroundings.radiance
        seen, room = np.empty(len(rays.origin)), (nothing_emitted(len(mean), np.float64), np.empty(len(mean)))
        around = self.sheets.reflected, float(mean.sum()), *self.excess
        _see(self.stage, hits, (rays.direction, rays.density), around, seen, room)
        return seen

    def _follow_through_media(self, met, rays) -> None:
        """Add to met, by number, what rays see that media scattered. rays: None without media."""
        for bounce in range(1, _BOUNCES + 1):
            if rays is None or len(rays.number) == 0:
                return
            hits = self.tracer.seen_from(FROM_DIFFUSE).trace(rays.origin, rays.direction)
            scattered = self._cross(hits, rays, _TRIAL_WALKING + NUMBERS * bounce, met)
            np.add.at(met, rays.number, rays.throughput * self._see(hits, rays))
            rays = scattered

    def _shown(self, hits, samples) -> _Shown:
        """The surfaces that the samples show."""
        count = len(samples.number)
        shown = _Shown(np.empty(count, np.int32), np.empty(count), np.empty(count))
        _locate(self.stage, hits, samples, self.eye.kind == 1, shown)
        return shown

    def _try_gathers(self, pixels, bounce, hits, samples, shown) -> _Tried:
        """Send trial rays, as a final gather would, from some of the surfaces that the samples show."""
        stage, first = self.stage, _SAMPLES * int(pixels[0]) if len(pixels) else 0
        chosen = np.flatnonzero(shown.sheet >= 0)
        chosen = chosen[(first + samples.number[chosen]) % self.stride == 0]
        rays = _Samples(*(np.empty((len(chosen), *column.shape[1:]), column.dtype) for column in samples))
        _start_gathers(stage.surfaces, bounce, hits, samples, chosen, rays)
        ends, met = self.tracer.seen_from(FROM_DIFFUSE).trace(rays.origin, rays.direction), np.zeros(len(chosen))
        scattered = self._cross(ends, rays, _TRIAL_WALKING, met)
        noise, closeness, rest = np.zeros((3, len(chosen)))
        _measure(stage, self.sheets, ends, rays, closeness, noise, rest)
        met += rays.throughput * self._see(ends, rays)
        self._follow_through_media(met, scattered)
        sheet = shown.sheet[chosen]
        stored = (ends.triangle >= 0) | ~self.excess.surroundings.open[sheet]
        return _Tried(
            pixel=pixels[samples.number[chosen] // _SAMPLES].astype(np.int32),
            sheet=sheet,
            met=met,
            bright=np.abs(met) * stored,
            noise=noise,
            closeness=closeness,
            density=1.0 / shown.footprint[chosen],
            rest=rest,
        )


def _go_astray(rays: _Samples, scattered: Scattered) -> _Samples:
    """The rays that go on where media scattered some. They look everywhere, so no pixels share what they see."""
    of = scattered.ray
    return _Samples(
        scattered.origin,
        scattered.direction,
        rays.number[of],
        rays.path[of],
        scattered.throughput,
        rays.way[of] + scattered.flown,
        np.full(len(of), 4.0 * np.pi),
        scattered.density,
    )


def _join_gathers(pixels: np.ndarray, samples: _Samples, shown: _Shown) -> _Gathers:
    """The gathers of pixels: samples of a pixel that show the same sheet share one gather."""
    _join(samples.number, shown.sheet, shown.throughput)
    first = np.flatnonzero(shown.throughput)
    pixel = pixels[samples.number[first] // _SAMPLES].astype(np.int32)
    return _Gathers(pixel, shown.sheet[first], shown.throughput[first])


def _straight(eye: Eye, key: np.uint64, pixels: np.ndarray) -> tuple[_Samples, np.ndarray]:
    """The samples of some pixels (n,), straight from the camera, and the reach of their rays: float32, see eye_rays."""
    count = _SAMPLES * len(pixels)
    origin, direction, reach = empty_eye_rays(count)
    eye_rays(eye, key, 0, np.full(len(pixels), _SAMPLES, np.uint16), pixels, origin, direction, reach)
    samples = _Samples(
        origin,
        direction,
        np.arange(count),
        np.empty(count, np.uint64),
        np.ones(count),
        np.empty(count),
        np.empty(count),
        np.full(count, ALONE),
    )
    _start_samples(eye, key, pixels, samples)
    return samples, reach


@njit(**KERNEL)
def _start_samples(eye, key, pixels, samples):
    """Fill in, for each sample, key, way from the camera to the ray's origin, and solid angle of the pixel."""
    high = (eye.frame[3] - eye.frame[2]) / eye.height
    size = (eye.frame[1] - eye.frame[0]) / eye.width * high
    for i in range(samples.way.size):
        samples.path[i] = path_key(key, _SAMPLES * pixels[i // _SAMPLES] + i % _SAMPLES)
        square = length2 = right = back = 0.0
        for axis in range(3):
            d = float(samples.direction[i, axis])
            square += (samples.origin[i, axis] - eye.matrix[axis, 3]) ** 2
            length2 += d * d
            right += d * eye.matrix[axis, 0]
            back += d * eye.matrix[axis, 2]
        samples.way[i], samples.angle[i] = np.sqrt(square), size
        if eye.kind == 0:
            samples.angle[i] /= length2 * np.sqrt(length2)
        elif eye.kind == 2:  # circles of latitude are shorter; next to a pole as in the middle of a pixel
            samples.angle[i] *= max(np.sqrt(right * right + back * back), 0.5 * high)


def _blocks(width: int, height: int, edge: int) -> np.ndarray:
    """(pixels,) int32, number of the block of edge x edge pixels in which each pixel lies."""
    rows, columns = np.arange(height, dtype=np.int32) // edge, np.arange(width, dtype=np.int32) // edge
    return (rows[:, None] * -(-width // edge) + columns).ravel()


def _sensitivity(radiance: np.ndarray, edges: np.ndarray) -> np.ndarray:
    """(p,) derivative of the apparent temperature with the radiance (p,), W m-2 sr-1, scaled to a mean square of 1.
    Ones if there is a pixel so dark that it has no temperature."""
    mean = float(radiance.mean())
    radiance = np.maximum(radiance, max(_FAINTEST * mean, 0.0))
    warmer, kelvin = (apparent_temperature(factor * radiance, edges) for factor in (1.0 + _STEP, 1.0))
    change = warmer - kelvin
    if not change.all():
        return np.ones_like(change)
    slope = change * (mean / radiance)
    return slope / np.sqrt(np.mean(slope**2))


def _cells(sheets: Sheets, block: np.ndarray, sensitivity: np.ndarray, gathers: _Gathers, tried: _Tried) -> Cells:
    """The Cells: gathers and their trial rays by cell."""
    labels = len(sheets.lit)
    key, cell = np.unique(block[gathers.pixel].astype(np.int64) * labels + gathers.sheet, return_inverse=True)
    ray_cell = np.searchsorted(key, block[tried.pixel].astype(np.int64) * labels + tried.sheet)
    count = np.bincount(cell, minlength=len(key))
    contribution = gathers.throughput * sensitivity[gathers.pixel]
    sheet = key % labels

    def mean_of(value):
        """Mean of a value of the trial rays in each cell, drawn to its mean over the whole sheet, and that to all."""
        of_sheet = drawn_means(tried.sheet, value, labels, value.mean() if value.size else 0.0, _FEW)
        return drawn_means(ray_cell, value, len(key), of_sheet[sheet], _PRIOR)

    spread = _drawn_variances(tried.sheet, tried.met, labels, tried.met.var() if tried.met.size else 0.0, _FEW)
    bright, lit = mean_of(tried.bright), sheets.lit[sheet]
    return Cells(
        key=key,
        brightness=np.where((bright > 0.0) & (lit > 0.0), bright / np.maximum(lit, 1e-300), 1.0),
        ray_noise=_drawn_variances(ray_cell, tried.met, len(key), spread[sheet], _PRIOR) + mean_of(tried.noise),
        met=mean_of(tried.met),
        closeness=mean_of(tried.closeness),
        density=mean_of(tried.density),
        rest=mean_of(tried.rest) + sheets.caustic_noise[sheet],
        count=count,
        contribution2=np.bincount(cell, contribution**2, len(key)) / np.maximum(count, 1),
    )


def _drawn_variances(label: np.ndarray, value: np.ndarray, labels: int, prior, worth: float) -> np.ndarray:
    """Variance (labels,) of the values of each label, drawn to the prior, which counts as `worth` more values."""
    count = np.bincount(label, minlength=labels)
    mean = np.bincount(label, value, labels) / np.maximum(count, 1)
    squares = np.bincount(label, (value - mean[label]) ** 2, labels)
    return (squares + worth * prior) / (np.maximum(count - 1, 0) + worth)


@njit(**INLINED)
def _diffuse_reflectance(stage, at):
    """Diffuse reflectance at an Interaction, in the mean of all bands. stage: see _in_one_band."""
    return diffuse_share(lobes_at(stage, at)) * one_reflectance_at(stage, at, BELOW, at.cosine)


@njit(**KERNEL)
def _see(stage, hits, rays, around, seen, room):
    """Fill seen (n,) with the excess radiance of all bands, W m-2 sr-1, that rays see: the emission, and the mean
    diffuse reflection of the sheet. Specular reflection is left out.

    rays: direction and density, see _Samples. around: (labels,) radiance reflected, see Sheets; mean radiance of the
    surroundings, W m-2 sr-1; Surroundings; Lamps. room: for emission, and for the sky's radiance.
    """
    (direction, density), (reflected, even, surroundings, lamps), (emitted, from_sky) = rays, around, room
    for i in range(hits.triangle.size):
        if hits.triangle[i] < 0:
            seen[i] = even
            if surroundings.sky.size > 0:
                way = vector(direction, i)
                seen[i] = radiance_from(surroundings, way, from_sky).sum()
                if density[i] < ALONE:
                    seen[i] *= share_of_sky(density[i], lamps, surroundings, way)
            continue
        at = interact(stage.surfaces, hits, i, direction)
        seen[i] = _diffuse_reflectance(stage, at) * reflected[sheet_of(stage.surfaces, at.side_id)]
        cosine = at.cosine if follows_fresnel(lobes_at(stage, at)) else _HEAD_ON
        radiance = emission_at(stage, emit_at(stage.surfaces, at.side_id, at.u, at.v, cosine), emitted)
        seen[i] += radiance.sum() * (share_of_ray(density[i], lamps, stage.surfaces, at) if density[i] < ALONE else 1.0)


@njit(**KERNEL)
def _locate(stage, hits, samples, is_parallel, shown):
    """Fill in what samples show. is_parallel: whether the camera's rays are parallel to each other."""
    for i in range(hits.triangle.size):
        shown.sheet[i], shown.throughput[i], shown.footprint[i] = -1, 0.0, 0.0
        if hits.triangle[i] < 0:
            continue
        at = interact(stage.surfaces, hits, i, samples.direction)
        reflectance = _diffuse_reflectance(stage, at)
        if reflectance == 0.0:
            continue
        shown.sheet[i] = sheet_of(stage.surfaces, at.side_id)
        shown.throughput[i] = samples.throughput[i] * reflectance / _SAMPLES
        way = 1.0 if is_parallel else samples.way[i] + at.distance
        shown.footprint[i] = max(samples.angle[i] * way * way / max(at.geometric_cosine, 1e-3), 1e-30)


@njit(**KERNEL)
def _follow(stage, bounce, hits, samples, unclear, onward):
    """Send on the samples that meet a specular surface, in one direction of its lobe; returns how many.

    unclear: (samples,) bool, set for samples that end on such a surface, and for samples that meet a rough lobe, where
    the direction is random.
    """
    sent = np.int64(0)
    for i in range(hits.triangle.size):
        if hits.triangle[i] < 0:
            continue
        at = interact(stage.surfaces, hits, i, samples.direction)
        lobes, path = lobes_at(stage, at), samples.path[i]
        if not is_specular(lobes):
            continue
        s, w = uniform(path, _DIMENSION + 4 * bounce + 2), uniform(path, _DIMENSION + 4 * bounce + 3)
        lobe = sample_specular(lobes, reflecting(stage.surfaces, lobes, at), s, w)
        cosine = facet_cosine(lobes, at, lobe.direction)
        reflectance = one_reflectance_at(stage, at, FACET, cosine)
        throughput = samples.throughput[i] * lobes.specular * reflectance * lobe.weight
        ends = throughput < _FAINT or bounce == _BOUNCES
        unclear[samples.number[i]] |= ends or is_glossy(lobes)
        if ends:
            continue
        leave(stage.surfaces, at.side_id, at.point, lobe.direction, onward, sent)
        onward.number[sent], onward.path[sent] = samples.number[i], path
        onward.throughput[sent], onward.angle[sent] = throughput, samples.angle[i]
        onward.density[sent] = ALONE
        onward.way[sent] = samples.way[i] + at.distance
        sent += 1
    return sent


@njit(**KERNEL)
def _start_gathers(surfaces, bounce, hits, samples, chosen, rays):
    """Start a ray of a final gather from each of the chosen samples (n,). Its number is its row."""
    for row in range(chosen.size):
        i, dimension = chosen[row], _DIMENSION + 4 * bounce
        at, path = interact(surfaces, hits, i, samples.direction), samples.path[i]
        direction = sample_diffuse(at.normal, uniform(path, dimension), uniform(path, dimension + 1))
        leave(surfaces, at.side_id, at.point, direction, rays, row)
        rays.number[row], rays.path[row], rays.throughput[row] = row, path, 1.0
        rays.way[row], rays.angle[row] = 0.0, 4.0 * np.pi
        rays.density[row] = TYPICAL_RAYS * diffuse_density(at.normal, direction)


@njit(**KERNEL)
def _measure(stage, sheets, hits, rays, closeness, noise, rest):
    """Fill closeness, noise and rest of trial rays that meet a surface, see _Tried.

    rest: over many rays from one point, each photon on the surface counts by the share of the point's view, weighed
    with the cosine there, that 1 m2 around the photon takes, but is blurred at least over the disk of the cache.
    """
    for i in range(hits.triangle.size):
        if hits.triangle[i] < 0:
            continue
        at = interact(stage.surfaces, hits, i, rays.direction)
        closeness[i] = 1.0 / max(at.distance, 1e-15)
        sheet, diffuse = sheet_of(stage.surfaces, at.side_id), _diffuse_reflectance(stage, at)
        disk = sheets.disk[sheet]
        if disk > 0.0:
            photons = (rays.throughput[i] * diffuse) ** 2 * sheets.photon_noise[sheet]
            noise[i] = photons / disk
            view = rays.density[i] / TYPICAL_RAYS * at.geometric_cosine * closeness[i] * closeness[i]  # of 1 m2
            rest[i] = photons * min(view, 1.0 / disk)


@njit(**KERNEL)
def _join(number, sheet, throughput):
    """Samples of a pixel that show the same sheet share a gather: the first gets the sum of throughputs, others 0."""
    for i in range(number.size):
        if sheet[i] < 0:
            continue
        j = i + 1
        while j < number.size and number[j] // _SAMPLES == number[i] // _SAMPLES:
            if sheet[j] == sheet[i]:
                throughput[i] += throughput[j]
                throughput[j] = 0.0
            j += 1
