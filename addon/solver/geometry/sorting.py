# SPDX-License-Identifier: GPL-3.0-or-later
"""Sorting of 64-bit keys in linear time, several times as fast as numpy's stable sort; and finding equal keys."""

import numpy as np

from ..system.kernels import njit

_DIGIT = 11  # bits that one round sorts by: the ends of its 2048 buckets stay in the first-level cache
_ROUNDS = (64 + _DIGIT - 1) // _DIGIT


@njit(cache=True, nogil=True)
def radix_sort(keys):
    """Sort (n,) uint64 keys, least significant digit first; equal keys stay in order. Overwrites the keys.

    Returns the numbers of the keys in ascending order, (n,) int32, and the sorted keys, (n,) uint64.
    """
    n = keys.size
    buckets = 1 << _DIGIT
    mask = np.uint64(buckets - 1)
    histogram = np.zeros((_ROUNDS, buckets), np.int32)
    for i in range(n):
        for r in range(_ROUNDS):
            histogram[r, (keys[i] >> np.uint64(r * _DIGIT)) & mask] += 1
    order, other = np.arange(n).astype(np.int32), np.empty(n, np.int32)
    other_keys = np.empty_like(keys)
    for r in range(_ROUNDS):
        shift = np.uint64(r * _DIGIT)
        if n == 0 or histogram[r, (keys[0] >> shift) & mask] == n:
            continue  # all keys have the same digit
        total = 0
        for bucket in range(buckets):
            size = histogram[r, bucket]
            histogram[r, bucket] = total
            total += size
        for i in range(n):
            bucket = (keys[i] >> shift) & mask
            slot = histogram[r, bucket]
            histogram[r, bucket] = slot + 1
            other_keys[slot] = keys[i]
            other[slot] = order[i]
        order, other = other, order
        keys, other_keys = other_keys, keys
    return order, keys


@njit(cache=True, nogil=True)
def first_alike(keys):
    """(n,) int32, for each of the (n,) uint64 keys the number of the first equal key. Overwrites the keys."""
    order, ascending = radix_sort(keys)
    first = np.empty_like(order)
    leader = 0
    for i in range(order.size):
        if i == 0 or ascending[i] != ascending[i - 1]:
            leader = order[i]
        first[order[i]] = leader
    return first
