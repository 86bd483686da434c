# SPDX-License-Identifier: GPL-3.0-or-later
"""Custom properties of Blender's data blocks, checked: the temperature above all."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ..solver.scene import SceneError, check_temperature


def read_number(id_block, key: str, default: float, owner: str, unit: str) -> float:
    """The custom property `key` as a float, default if it is not set. Raises SceneError if it is no number.

    owner: how the message names the data block. unit: what the message says after "expected a number".
    """
    value = id_block.get(key)
    if value is None:
        return default
    if not is_number(value):
        raise SceneError(f"{owner}: {key} is {describe(value)}, expected a number{unit}")
    return float(value)


def read_choice(id_block, key: str, owner: str) -> bool:
    """The custom property `key`, which is true or false; false if it is not set. 0 and 1 count, too, as older Blenders
    write them. Raises SceneError if it is anything else."""
    value = id_block.get(key)
    if value is None:
        return False
    if not isinstance(value, int) or value not in (0, 1):
        raise SceneError(f"{owner}: {key} is {describe(value)}, expected true or false")
    return bool(value)


def is_number(value) -> bool:
    """Whether the value of a custom property is a number; True and False are none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def number_hint(key: str, text: str) -> str:
    """What to do where a text stands for a number: end of a message about that text; empty if it is no number."""
    try:
        float(text.replace(",", "."))
    except ValueError:
        return ""
    return f"; {key} is a text: for a number set the property's type to Float, or write it without quotes"


def driver_remark(id_block, key: str = "temperature", unit: str = " K", zero: bool = False) -> str:
    """What is wrong with the driver of a custom property, and which value counts; an empty text if nothing is.

    Blender puts 0 where a driver fails, gives no number or may not run its script, and only of a failure it leaves a
    sign. So any 0 is told, unless people drive it there (zero): hardly anybody does that with a temperature.
    """
    animation, value = (id_block.original or id_block).animation_data, id_block.get(key)
    curve = animation.drivers.find(f'["{key}"]') if animation else None
    if curve is None or curve.mute or not isinstance(value, int | float):
        return ""
    if not curve.driver.is_valid:
        return f"{_name_of(curve, key)} fails; what the property holds counts: {value:.5g}{unit}"
    if value == 0.0 and not zero:
        why = "as it does if its result is no number or scripts may not run"
        return f"{_name_of(curve, key)} gives 0{unit}, {why}; 0{unit} counts"
    return ""


def driver_remarks(id_block, keys: Iterable[str], zero: bool = True) -> list[str]:
    """What driver_remark says of several properties without a unit; nothing of those that are well."""
    return [remark for key in keys if (remark := driver_remark(id_block, key, "", zero))]


def setting_remarks(scene) -> Iterator[str]:
    """Which drivers of the scene's settings of this engine fail, and which values count."""
    animation = (scene.original or scene).animation_data
    for curve in animation.drivers if animation else ():
        group, _, name = curve.data_path.partition(".")
        if group == "infrared" and not curve.mute and not curve.driver.is_valid:
            yield f"{_name_of(curve, name)} fails; what the setting holds counts: {getattr(scene.infrared, name)}"


def _name_of(curve, key: str) -> str:
    """How messages call the driver of a value."""
    scripted = curve.driver.type == "SCRIPTED"
    return f"the driver '{curve.driver.expression}' of {key}" if scripted else f"the driver of {key}"


def describe(value) -> str:
    """A custom property's value as users know it, shortened to 60 characters."""
    if hasattr(value, "to_dict"):
        value = value.to_dict()
    elif hasattr(value, "to_list"):
        value = value.to_list()
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def read_temperature(id_block, default: float, owner: str) -> float:
    """The custom property `temperature`, K, default if it is not set. Raises SceneError if it is no temperature."""
    temperature = read_number(id_block, "temperature", default, owner, " in kelvin")
    check_temperature(temperature, owner)
    return temperature
