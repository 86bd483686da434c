# SPDX-License-Identifier: GPL-3.0-or-later
"""Cryptomatte without Blender: hashes, ranks and attributes."""

import json
from collections import Counter

import numpy as np
import pytest

from addon.output.cryptomatte import as_float, attributes, murmur_hash, ranked


# of the tests of Cryptomatte's authors: nuke/cryptomatte_utilities_tests.py
@pytest.mark.parametrize(
    "name, expected",
    [
        ("hello", 6.0705627102400005616e-17),
        ("cube", -4.08461912519e15),
        ("sphere", 2.79018604383e15),
        ("plane", 3.66557617593e-11),
        ("равнина", -1.3192631212399999468e-25),
        ("mädchen", 6.2361298211599995797e25),
    ],
)
def test_ids_are_those_of_the_authors_tests(name, expected):
    assert as_float([murmur_hash(name)])[0] == pytest.approx(expected, rel=1e-6)  # float32; some have 12 digits


# of https://en.wikipedia.org/wiki/MurmurHash, and of scikit-learn's test_murmurhash.py (there as signed numbers)
@pytest.mark.parametrize(
    "text, expected",
    [
        ("", 0),
        ("test", 0xBA6BD213),
        ("Hello, world!", 0xC0363E43),
        ("The quick brown fox jumps over the lazy dog", 0x2E4FF723),
        ("foo", -156908512 % 2**32),
    ],
)
def test_hashes_are_those_that_are_published(text, expected):
    assert murmur_hash(text) == expected


def test_ids_are_ordinary_numbers():
    """Where a hash would be none, the lowest bit of the exponent is turned, and nothing else."""
    hashes = np.array([0, 1, 0x7F800000, 0x7FC00001, 0xFF800000, 0x007FFFFF, 0x3F800000, 0x80000000], np.uint32)
    ids = as_float(hashes)
    assert (np.isfinite(ids) & (np.abs(ids) >= np.finfo(np.float32).tiny)).all()
    turned = [1 << 23 if exponent in (0, 255) else 0 for exponent in (hashes >> 23 & 255).tolist()]
    assert (ids.view(np.uint32) ^ hashes).tolist() == turned


@pytest.mark.parametrize("levels", [1, 2, 6, 20])
def test_things_are_ranked_by_their_coverage(levels):
    rng = np.random.default_rng(levels)
    samples = rng.integers(0, 6, (16, 200)) * (rng.random((16, 200)) < 0.8)
    samples[:, 0], samples[:, 1] = 0, 3
    ids = np.float32([1.5, 2.5, 3.5, 4.5, 5.5])
    result = ranked(samples.astype(np.int32), ids, levels)
    assert result.shape == (200, 2 * levels) and result.dtype == np.float32
    for pixel in range(200):
        counts = Counter(samples[:, pixel].tolist())
        counts.pop(0, None)
        found = [(float(i), float(c)) for i, c in result[pixel].reshape(-1, 2) if c > 0.0]
        assert [c for _, c in found] == [c / 16 for _, c in counts.most_common(levels)]
        assert all(counts[round(i - 0.5)] == 16 * c for i, c in found) and len(set(found)) == len(found)
    assert not result[0].any() and result[1, :2].tolist() == [3.5, 1.0]


def test_attributes_name_the_things():
    found = attributes("ViewLayer.CryptoObject", ["Würfel", 'a "b"'])
    # Cycles gives the layer of this name the same key
    assert list(found) == [f"cryptomatte/542cafa/{each}" for each in ("name", "hash", "conversion", "manifest")]
    assert found["cryptomatte/542cafa/name"] == "ViewLayer.CryptoObject"
    manifest = json.loads(found["cryptomatte/542cafa/manifest"])
    assert manifest == {name: f"{as_float([murmur_hash(name)]).view(np.uint32)[0]:08x}" for name in ("Würfel", 'a "b"')}
