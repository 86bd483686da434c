# SPDX-License-Identifier: GPL-3.0-or-later
"""Cryptomatte: which things a pixel sees, each with its share, by hashes of their names.

Source: J. Friedman and A. C. Jones, 'Cryptomatte specification', version 1.2.0
(https://github.com/Psyop/Cryptomatte). The hash is A. Appleby's MurmurHash3_x86_32 with the seed 0 (public domain).
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence

import numpy as np

_32_BITS = 0xFFFFFFFF


def murmur_hash(name: str) -> int:
    """MurmurHash3_x86_32 of a name in UTF-8, seed 0: from 0 to 2^32 - 1."""
    data = name.encode("utf-8")
    whole = len(data) // 4 * 4
    state = 0
    for start in range(0, whole, 4):
        state ^= _mixed(int.from_bytes(data[start : start + 4], "little"))
        state = (_rotated(state, 13) * 5 + 0xE6546B64) & _32_BITS
    state ^= _mixed(int.from_bytes(data[whole:], "little")) ^ len(data)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35)):
        state = (state ^ state >> shift) * factor & _32_BITS
    return state ^ state >> 16


def _rotated(value: int, bits: int) -> int:
    return (value << bits | value >> 32 - bits) & _32_BITS


def _mixed(block: int) -> int:
    return _rotated(block * 0xCC9E2D51 & _32_BITS, 15) * 0x1B873593 & _32_BITS


def as_float(hashes: Sequence[int]) -> np.ndarray:
    """(n,) float32 with the bits of n hashes. The lowest bit of the exponent is turned where the number would be zero,
    denormal, infinite or NaN, which not all programs keep."""
    bits = np.asarray(hashes, np.uint32)
    exponent = bits >> np.uint32(23) & np.uint32(255)
    return np.where((exponent == 0) | (exponent == 255), bits ^ np.uint32(1 << 23), bits).view(np.float32)


def ranked(samples: np.ndarray, ids: np.ndarray, levels: int) -> np.ndarray:
    """(n, 2 * levels) float32 id, coverage, id, coverage ... of n pixels, the largest coverage first, then zeros.

    samples: (s, n) int32, what each of s rays through a pixel sees: 1 + index into ids, 0 for nothing, which has no
    coverage. ids: (m,) float32.
    """
    count, pixels = samples.shape
    sorted_samples = np.sort(samples, axis=0)
    new = np.ones(samples.shape, bool)
    new[1:] = sorted_samples[1:] != sorted_samples[:-1]
    # of what a sample sees, among all that its pixel does
    place = np.cumsum(new, axis=0) - 1 + count * np.arange(pixels)
    covered = np.bincount(place.ravel(), minlength=count * pixels).reshape(pixels, count)
    seen = np.zeros(pixels * count, np.int64)
    seen[place] = sorted_samples
    seen = seen.reshape(pixels, count)
    covered[seen == 0] = 0
    order = np.argsort(-covered, axis=1, kind="stable")[:, :levels]
    covered, seen = (np.take_along_axis(each, order, axis=1) for each in (covered, seen))
    result = np.zeros((pixels, levels, 2), np.float32)
    result[:, : order.shape[1], 0] = np.where(covered > 0, np.append(np.float32(0.0), ids)[seen], 0.0)
    result[:, : order.shape[1], 1] = covered / count
    return result.reshape(pixels, 2 * levels)


def attributes(name: str, things: Iterable[str]) -> dict[str, str]:
    """The attributes of a file, or of a render, with images whose channels begin with this name: by them programs know
    the things by their names."""
    prefix = f"cryptomatte/{murmur_hash(name):08x}"[: len("cryptomatte/") + 7]
    manifest = {each: f"{int(as_float([murmur_hash(each)]).view(np.uint32)[0]):08x}" for each in sorted(things)}
    return {
        f"{prefix}/name": name,
        f"{prefix}/hash": "MurmurHash3_32",
        f"{prefix}/conversion": "uint32_to_float32",
        f"{prefix}/manifest": json.dumps(manifest, ensure_ascii=False, separators=(",", ":")),
    }
