# SPDX-License-Identifier: GPL-3.0-or-later
"""Which material of the library a name means, such as "Brushed_Aluminum.003".

Whole words count, never parts of them: "steelcase" is no steel, "glassware" no glass, "silicone" no silicon. A word may
mean something else beside others ("ice cream"), so a row can name words that forbid it. And a name alone never makes a
metal: `Meaning.surface` says what the shader must look like.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from ..solver.physics import library

# What the surface must be for a meaning to count
METALLIC, SEE_THROUGH, NO_METAL, ANY = "metallic", "see-through", "no metal", "any"


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


WORN = "weathered oxidised oxidized corroded patina patinated"
OLD = "old aged mossy weathered"
RUST = "rust rusty rusted"
ALUMINIUM = "aluminium aluminum alu"
# Only a colour or a look, beside the name of a metal
LOOKS = _words("color colour colored coloured look like imitation faux fake hair fur fish leather fabric cloth wood")
COATINGS = _words("paint painted carpaint lacquer lacquered varnish varnished enamel enameled enamelled coated")


@dataclass(frozen=True)
class Meaning:
    """A row of the table of names: each of `words` holds alternatives, one of which must be in the name, and none of
    `without`. entry: the library's material. surface: METALLIC, SEE_THROUGH, NO_METAL or ANY. why: what the artist may
    wonder about."""

    entry: str
    surface: str
    words: tuple[frozenset[str], ...]
    without: frozenset[str] = frozenset()
    why: str = ""


def _metal(entry: str, *words: str, surface: str = METALLIC) -> Meaning:
    return Meaning(entry, surface, tuple(map(_words, words)), LOOKS)


def _other(entry: str, *words: str, without: str = "", surface: str = NO_METAL, why: str = "") -> Meaning:
    return Meaning(entry, surface, tuple(map(_words, words)), _words(without), why)


# Where several rows fit, the one with the most words counts, then the first.
MEANINGS = (
    _metal("Gold, polished", "gold golden"),
    _metal("Silver, polished", "silver sterling"),
    _metal("Copper, polished", "copper"),
    _metal("Brass, polished", "brass bronze"),
    _metal("Chromium, polished", "chrome chromium"),
    _metal("Nickel, polished", "nickel"),
    _metal("Platinum, polished", "platinum"),
    _metal("Titanium, polished", "titanium"),
    _metal("Tungsten, polished", "tungsten"),
    _metal("Zinc, polished", "zinc"),
    _metal("Lead, polished", "lead"),
    _metal("Iron, polished", "iron"),
    _metal("Steel, cold rolled", "steel inox"),
    _metal("Aluminium, polished", ALUMINIUM),
    _metal("Aluminium, weathered", ALUMINIUM, WORN, surface=ANY),
    _metal("Aluminium, anodised grey", "anodised anodized", ALUMINIUM, surface=ANY),
    _metal("Aluminium, anodised black", "anodised anodized", ALUMINIUM, "black", surface=ANY),
    _metal("Lead, weathered", "lead", WORN, surface=ANY),
    _metal("Iron, weathered", RUST, surface=ANY),
    _metal("Iron, weathered", "iron", WORN, surface=ANY),
    _metal("Iron, weathered", "iron steel metal", RUST, surface=ANY),
    _metal("Steel, galvanised, heavily oxidised", "galvanised galvanized", WORN, surface=ANY),
    _other(
        "Water",
        "water seawater ocean puddle",
        surface=SEE_THROUGH,
        without="bottle tank tap pipe hose melon color colour lily mill tower gun cooler heater jug wheel ice glass",
    ),
    _other("Ice", "ice icicle", without="cream lolly skate hockey box bucket age tea pack axe blue"),
    _other(
        "Snow, coarse-grained", "snow", without="boot shoe ski man board globe mobile white jacket goggles tire chain"
    ),
    _other(
        "Skin, human", "skin", without="car orange banana apple fruit leather snake lizard fish animal drum sheep phone"
    ),
    _other(
        "Glass, window",
        "glass windshield windscreen windowpane",
        surface=SEE_THROUGH,
        without="fiber fibre frame holder case",
    ),
    _other(
        "Glass, window",
        "mirror",
        surface=ANY,
        without="metal chrome steel silver gold copper aluminium aluminum polished ball sphere finish",
        why="a mirror's silver lies behind glass",
    ),
    _other("Fused silica", "fused", "silica quartz", surface=SEE_THROUGH),
    _other("Alumina", "alumina"),
    _other("Zirconia", "zirconia"),
    _other("Soot", "soot"),
    _other("Plastic, PMMA (acrylic)", "acrylic plexiglas plexiglass perspex pmma lucite", without="yarn wool nail"),
    _other("Plastic, polycarbonate", "polycarbonate lexan makrolon"),
    _other("Plastic, PVC", "pvc vinyl"),
    _other("Plastic, PET", "pet", "plastic bottle"),
    _other("Plastic, polystyrene", "polystyrene styrofoam"),
    _other("Plastic, polyimide", "polyimide kapton"),
    _other("Silicone rubber (PDMS)", "silicone pdms"),
    _other("Asphalt, road", "asphalt tarmac bitumen"),
    _other("Brick, new", "brick bricks"),
    _other("Brick, weathered", "brick bricks", OLD),
    _other("Concrete, new", "concrete cement"),
    _other("Concrete, weathered", "concrete cement", OLD),
    _other("Granite", "granite"),
    _other("Limestone", "limestone"),
    _other("Sandstone", "sandstone"),
    _other("Roof tile, ceramic", "roof roofing", "tile tiles"),
    _other("Roof tile, ceramic", "terracotta"),
    _other("Paint, ultra-flat black", "paint painted", "black", "flat matt matte", surface=ANY),
)


def words_of(name: str) -> set[str]:
    """The words of a name, in small letters: parted by all but letters, and where small letters meet a capital."""
    runs = re.findall(r"[^\W\d_]+", name)
    parts = (re.findall(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[^\W\d_A-Z]+|[A-Z]+", run) for run in runs)
    return {word.casefold() for found in parts for word in found}


def singulars(words: set[str]) -> set[str]:
    """The words, and each that may be a plural without its s."""
    return words | {word[:-1] for word in words if len(word) > 3 and word.endswith("s") and not word.endswith("ss")}


def is_coating(name: str) -> bool:
    """Whether a name speaks of paint or the like, which hides what is below it."""
    return bool(COATINGS & singulars(words_of(name)))


def meanings(name: str) -> list[Meaning]:
    """What a name may mean, the likeliest first: a material of the library of just these words, then the artist's own
    materials all of whose words are in it, then rows of the table."""
    exact, words = words_of(name), singulars(words_of(name))
    own = [key for key, known in library.materials().items() if known.kind == "own"]
    same = [key for key in library.materials() if exact and words_of(key) == exact]
    within = [key for key in own if words_of(key) and words_of(key) <= words]
    within.sort(key=lambda key: -len(words_of(key)))
    rows = [row for row in MEANINGS if all(each & words for each in row.words) and not row.without & words]
    rows.sort(key=lambda row: -len(row.words))
    return [Meaning(key, ANY, ()) for key in dict.fromkeys(same + within)] + rows


def named_metal(name: str) -> bool:
    """Whether a name has the name of a metal in it."""
    return any(row.surface == METALLIC for row in meanings(name))
