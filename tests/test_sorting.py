# SPDX-License-Identifier: GPL-3.0-or-later
"""Sorting of 64-bit keys against numpy's stable sort, which compares where this one counts digits."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from addon.solver.geometry.sorting import first_alike, radix_sort

LARGEST = 2**64 - 1
# A digit has 11 bits, the last 9: keys around each border between two, where a shift or mask that is off would show
BORDERS = sorted({min(LARGEST, (1 << bit) + step) for bit in range(0, 65, 11) for step in (-1, 0, 1)})
keys_of = st.lists(
    st.one_of(st.integers(0, LARGEST), st.sampled_from([*BORDERS, 2**63, LARGEST]), st.integers(0, 3)), max_size=200
).map(lambda values: np.array(values, np.uint64))


def check_sorted(keys):
    """Order and keys are those of numpy's stable sort."""
    expected = np.argsort(keys, kind="stable")
    order, ascending = radix_sort(keys.copy())
    np.testing.assert_array_equal(order, expected)
    np.testing.assert_array_equal(ascending, keys[expected])
    assert order.dtype == np.int32 and ascending.dtype == np.uint64


def check_first(keys):
    """numpy's unique names the first of equal values."""
    _, first, inverse = np.unique(keys, return_index=True, return_inverse=True)
    found = first_alike(keys.copy())
    np.testing.assert_array_equal(found, first[inverse])
    assert found.dtype == np.int32


@settings(deadline=None, derandomize=True, max_examples=200, database=None)
@given(keys_of)
def test_any_keys(keys):
    check_sorted(keys)
    check_first(keys)


@pytest.mark.parametrize(
    "keys",
    [
        np.empty(0, np.uint64),
        np.array([LARGEST], np.uint64),
        np.full(5000, 2**40, np.uint64),
        np.arange(5000, dtype=np.uint64)[::-1],
        np.tile(np.array([0, LARGEST], np.uint64), 2500),
    ],
    ids=["none", "one", "all alike", "descending", "both ends"],
)
def test_plain_keys(keys):
    check_sorted(keys)
    check_first(keys)


@pytest.mark.parametrize("bits", [1, 11, 12, 32, 53, 64], ids=lambda bits: f"{bits} bits")
def test_many_keys(bits):
    """Of few bits most are alike, so that their order tells whether the sort is stable. 64 bits: the whole range."""
    rng = np.random.default_rng(bits)
    keys = rng.integers(0, 2**bits, 100_000, dtype=np.uint64)
    check_sorted(keys)
    check_first(keys)


@pytest.mark.parametrize("shift", range(0, 64, 11))
def test_keys_that_differ_in_one_digit(shift):
    """Rounds in which all are alike are left out; what was read in one must be what the next reads."""
    rng = np.random.default_rng(shift)
    digit = rng.integers(0, min(2**11, 2 ** (64 - shift)), 3000, dtype=np.uint64)
    check_sorted(digit << np.uint64(shift))
