# SPDX-License-Identifier: GPL-3.0-or-later
"""Values of the user's scene that are changed for a while and then put back."""

from __future__ import annotations

from contextlib import suppress

import bpy
import numpy as np

from .properties import set_custom_property


class Kept:
    """Sets attributes and custom properties of Blender's data, and remembers what they were."""

    def __init__(self):
        self._attributes = {}  # (pointer, name) -> (owner, name, what it was)
        self._properties = {}  # (pointer, key) -> (block, key, what it was, how it is shown, may be overridden)
        self._latest = {}  # (pointer, name or key) -> (name of the owner, how to read the value now, what was set)
        self._copies = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.restore()

    def keep(self, owner, *names: str) -> None:
        """Remember attributes as they are now, unless that was done before. Restored in this order."""
        for name in names:
            self._attributes.setdefault((owner.as_pointer(), name), (owner, name, _plain(getattr(owner, name))))

    def set(self, owner, **values) -> None:
        """Set attributes of a data block or a group of settings."""
        self.keep(owner, *values)
        for name, value in values.items():
            setattr(owner, name, value)
            now = _plain(getattr(owner, name))
            self._latest[owner.as_pointer(), name] = owner, name, now

    def set_property(self, block, key: str, value) -> None:
        """Set a custom property of a data block; None removes it."""
        if (block.as_pointer(), key) not in self._properties:
            self._properties[block.as_pointer(), key] = block, key, *_present(block, key)
        if value is None:
            block.pop(key, None)
        else:
            _assign(block, key, value)
            self._latest[block.as_pointer(), key] = block, f'["{key}"]', _plain(block[key])
        block.update_tag()

    def set_data(self, obj, data) -> None:
        """Give an object a mesh, or other data, that is removed at the end."""
        self.set(obj, data=data)
        self._copies.append(data)

    def overwritten(self) -> list[str]:
        """Names of owner and attribute whose value is no longer what was set last: something animates it."""
        found = []
        for owner, name, value in self._latest.values():
            now = owner.get(name[2:-2]) if name.startswith("[") else getattr(owner, name)
            if not _same(_plain(now), value):
                found.append(f"'{owner.name}': {name}")
        return found

    def restore(self) -> None:
        """Put everything back as it was."""
        for owner, name, value in self._attributes.values():
            setattr(owner, name, value)
        for block, key, value, shown, overridable in self._properties.values():
            if value is None:
                block.pop(key, None)
            else:
                _assign(block, key, value)
                if shown != _shown(block, key):
                    block.id_properties_ui(key).update(**shown)
                if overridable:
                    block.property_overridable_library_set(f'["{key}"]', True)
            block.update_tag()
        bpy.data.batch_remove(self._copies)
        for table in (self._attributes, self._properties, self._latest, self._copies):
            table.clear()


def _assign(block, key: str, value) -> None:
    """Set a custom property. One of another type is removed first: how Blender showed it would else stay in memory."""
    if type(_plain(block.get(key))) is not type(value):
        block.pop(key, None)
    set_custom_property(block, key, value)


def _present(block, key: str) -> tuple[object, dict, bool]:
    """A custom property's value, None without one, how Blender shows it, and whether overrides may change it."""
    if key not in block:
        return None, {}, False
    return _plain(block[key]), _shown(block, key), block.is_property_overridable_library(f'["{key}"]')


def _shown(block, key: str) -> dict:
    """How Blender shows a custom property; not every kind of value is shown in some way."""
    with suppress(TypeError):
        return block.id_properties_ui(key).as_dict()
    return {}


def _plain(value):
    """A value that does not change with its owner."""
    convert = getattr(value, "to_dict", None) or getattr(value, "to_list", None)
    if convert:
        return convert()
    if isinstance(value, str | set) or hasattr(value, "as_pointer") or not hasattr(value, "__len__"):
        return value
    return tuple(value)


def _same(one, other) -> bool:
    if isinstance(other, tuple | list | float) and one is not None:
        return np.shape(one) == np.shape(other) and np.allclose(one, other, rtol=1e-6, atol=1e-6)  # float32
    return one == other
