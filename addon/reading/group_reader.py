# SPDX-License-Identifier: GPL-3.0-or-later
"""Temperature groups of objects and the world, from their custom property `temperature_group`, a name."""

from __future__ import annotations

import numpy as np

from ..solver.scene import SceneError

KEY = "temperature_group"


def read_group(id_block, owner: str) -> str:
    """The name of the group that an object or the world is in; '' is none. Raises SceneError if it is no text."""
    name = id_block.get(KEY) or ""
    if not isinstance(name, str):
        raise SceneError(f"{owner}: {KEY} is {name!r}, expected the name of a group")
    return name.strip()


class GroupReader:
    """Gives groups their numbers, in the order in which they are met, and sees to it that each has one temperature."""

    def __init__(self):
        self._members: dict[str, tuple[int, str, float]] = {}  # group -> number, its first member, K

    @property
    def names(self) -> tuple[str, ...]:
        """Of the groups, by number."""
        return tuple(self._members)

    @property
    def temperatures(self) -> dict[str, float]:
        """K, by group."""
        return {name: kelvin for name, (_, _, kelvin) in self._members.items()}

    def number(self, id_block, owner: str, temperature: np.ndarray) -> int:
        """The number of the group that an object or the world is in, -1 for none.

        owner: how messages name it. temperature: all that it has, K.
        Raises SceneError if the temperature varies, or differs from that of others in the group.
        """
        name = read_group(id_block, owner)
        if not name:
            return -1
        low, high = float(np.min(temperature)), float(np.max(temperature))
        if low < high:
            raise SceneError(
                f"{owner}: its temperature varies from {low:.6g} to {high:.6g} K, but it is in the temperature group "
                f"'{name}'; a group has one temperature"
            )
        number, other, kelvin = self._members.setdefault(name, (len(self._members), owner, low))
        if low != kelvin:
            raise SceneError(
                f"{owner} ({low:.6g} K) and {other} ({kelvin:.6g} K) are in the temperature group '{name}'; a group "
                "has one temperature"
            )
        return number
