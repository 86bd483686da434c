# SPDX-License-Identifier: GPL-3.0-or-later
"""Files that say which values of a scene are drawn at random for each frame, and within which ranges.

The format is described in docs/pairs.md. Nothing here knows of Blender.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..solver.scene import SceneError

try:
    import yaml  # Blender does not bring it
except ImportError:
    yaml = None

AXES = "x", "y", "z"


class Kind(NamedTuple):
    """What values of a key may be. least, most: of a number. parts: names of the numbers; empty for one."""

    least: float = -math.inf
    most: float = math.inf
    parts: tuple[str, ...] = ()
    needed: tuple[str, ...] = ()


_PLACE = Kind(parts=AXES)
_SHARE = Kind(0.0, 1.0)
_KELVIN = Kind(0.0)
POSES = {"location": _PLACE, "move": _PLACE, "rotation": _PLACE, "turn": _PLACE}
SECTIONS = {
    "objects": {"temperature": _KELVIN, "warmer": Kind(), **POSES, "scale": Kind(math.ulp(0.0)), "visible": _SHARE},
    "materials": {"emissivity": _SHARE, "specular": _SHARE, "roughness": _SHARE},
    "world": {
        "temperature": _KELVIN,
        "warmer": Kind(),
        "clear_sky": Kind(0.0, parts=("air", "humidity", "cover"), needed=("air", "humidity")),
    },
    "camera": {**POSES, "focal_length": Kind(1.0, 5000.0)},
}  # fmt: skip
SELECTORS = {"objects": ("name", "category"), "materials": ("name",), "world": (), "camera": ()}


@dataclass(frozen=True)
class Rule:
    """What is drawn of some things. where: its place in the file, for messages. section: of the file.

    selectors: patterns of "name" and texts of "category", those that are given. ranges: low and high of each part by
    key; the only part of a number is "". visible: probability; None if it is not drawn. together: name of what shares
    its draws; empty if each thing has its own.
    """

    where: str
    section: str
    selectors: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    ranges: Mapping[str, Mapping[str, tuple[float, float]]] = field(default_factory=dict)
    visible: float | None = None
    together: str = ""


def uniform(seed: int, frame: int, stream: str) -> float:
    """A random number from 0 up to 1 that depends on these alone. stream: what is drawn."""
    name = int.from_bytes(hashlib.blake2b(stream.encode(), digest_size=8).digest(), "little")
    return float(np.random.default_rng((seed, frame, name)).random())


def frame_seed(seed: int, frame: int) -> int:
    """The seed of a frame's renders, 0 to 2**31 - 1."""
    return int(uniform(seed, frame, "seed of the renders") * 2**31)


def read_rules(path: Path) -> list[Rule]:
    """The rules of a file in JSON or YAML. Raises SceneError, naming file, key and value, if it makes no sense, and
    OSError if it cannot be read."""
    content = _content(path)
    try:
        return _rules(content)
    except SceneError as error:
        raise SceneError(f"'{path}': {error}") from None


def _content(path: Path):
    if path.suffix.lower() in (".yaml", ".yml"):
        if yaml is None:
            raise SceneError(
                f"'{path}' is YAML, which needs the Python package PyYAML, and this Python has none: write the file as "
                "JSON, which says the same, or install PyYAML"
            )
        read, problems = _read_yaml, (yaml.YAMLError, ValueError, RecursionError)
    else:
        read, problems = _read_json, (ValueError, RecursionError)
    try:
        return read(path.read_text(encoding="utf-8-sig"))
    except UnicodeDecodeError:
        raise SceneError(f"'{path}' cannot be read: it is no text in UTF-8") from None
    except problems as error:
        raise SceneError(f"'{path}' cannot be read: {' '.join(str(error).split())}") from None


def _read_json(text: str):
    def of_pairs(pairs: Sequence[tuple[str, object]]) -> dict:
        _check_once([key for key, _ in pairs])
        return dict(pairs)

    return json.loads(text, object_pairs_hook=of_pairs)


def _read_yaml(text: str):
    _check_node(yaml.compose(text, yaml.SafeLoader), ())
    return yaml.safe_load(text)


def _check_node(node, above: Sequence) -> None:
    """Raise ValueError if a node of YAML has a key twice, or contains itself. above: the nodes that it is in."""
    if not isinstance(node, yaml.CollectionNode):
        return
    if node in above:
        raise ValueError(f"the alias of line {node.start_mark.line + 1} stands for what it is in")
    children = node.value
    if isinstance(node, yaml.MappingNode):
        _check_once([key.value for key, _ in node.value])
        children = [each for pair in node.value for each in pair]
    for each in children:
        _check_node(each, (*above, node))


def _check_once(keys: Sequence) -> None:
    """Raise ValueError if a key is given twice, of which the parsers would keep the last one."""
    for i, key in enumerate(keys):
        if key in keys[:i]:
            raise ValueError(f"the key {_shown(key)} is given twice")


def _rules(content) -> list[Rule]:
    _check_keys(content, SECTIONS, "the file")
    rules = []
    for section, value in content.items():
        if not SELECTORS[section]:
            rules.append(_rule(section, section, value))
            continue
        if not isinstance(value, list):
            raise SceneError(f"{section} is {_shown(value)}, expected a list of rules")
        rules += [_rule(section, f"{section}[{i}]", each) for i, each in enumerate(value)]
    return rules


def _rule(section: str, where: str, value) -> Rule:
    kinds, selecting = SECTIONS[section], SELECTORS[section]
    _check_keys(value, (*selecting, *kinds, "together"), where)
    selectors = {key: _texts(f"{where}.{key}", value[key]) for key in selecting if key in value}
    together = value.get("together", "")
    if not isinstance(together, str):
        raise SceneError(f"{where}.together is {_shown(together)}, expected a text")
    if selecting and not selectors:
        raise SceneError(f"{where} says of nothing what it draws, expected {' or '.join(selecting)}")
    drawn = [key for key in value if key in kinds]
    if not drawn:
        raise SceneError(f"{where} draws nothing, expected one of {', '.join(kinds)}")
    visible = None
    if "visible" in drawn:
        visible = value["visible"]
        if not _is_number(visible) or not 0.0 <= visible <= 1.0:
            raise SceneError(f"{where}.visible is {_shown(visible)}, expected a probability from 0 to 1")
        drawn.remove("visible")
    ranges = {key: _ranges(f"{where}.{key}", kinds[key], value[key]) for key in drawn}
    return Rule(where, section, selectors, ranges, visible, together)


def _texts(where: str, value) -> tuple[str, ...]:
    texts = value if isinstance(value, list) else [value]
    if not texts or not all(isinstance(text, str) and text for text in texts):
        raise SceneError(f"{where} is {_shown(value)}, expected a text, or a list of texts")
    return tuple(texts)


def _ranges(where: str, kind: Kind, value) -> dict[str, tuple[float, float]]:
    if not kind.parts:
        return {"": _range(where, kind, value)}
    _check_keys(value, kind.parts, where)
    missing = [part for part in kind.needed if part not in value]
    if missing or not value:
        raise SceneError(f"{where} is {_shown(value)}, expected {', '.join(missing or kind.parts)} in it")
    return {part: _range(f"{where}.{part}", kind, each) for part, each in value.items()}


def _range(where: str, kind: Kind, value) -> tuple[float, float]:
    if not isinstance(value, Sequence) or len(value) != 2 or not all(map(_is_number, value)):
        raise SceneError(f"{where} is {_shown(value)}, expected a range [low, high]")
    low, high = map(float, value)
    if low > high:
        raise SceneError(f"{where} is {_shown(value)}, an empty range: its low end is above the high one")
    if not kind.least <= low or not high <= kind.most:
        limit = f"from {kind.least:g} to {kind.most:g}" if math.isfinite(kind.most) else f"of at least {kind.least:g}"
        raise SceneError(f"{where} is {_shown(value)}, expected values {limit}")
    return low, high


def _check_keys(value, known: Sequence[str] | Mapping, where: str) -> None:
    if not isinstance(value, Mapping):
        raise SceneError(f"{where} is {_shown(value)}, expected keys with values")
    for key in value:
        if key not in known:
            raise SceneError(f"{where} has an unknown key {_shown(key)}, expected {', '.join(known)}")


def _is_number(value) -> bool:
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:  # of an integer that no float can hold
        return False


def _shown(value) -> str:
    text = json.dumps(value, default=str, skipkeys=True)
    return text if len(text) <= 60 else text[:57] + "..."
