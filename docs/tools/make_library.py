# SPDX-License-Identifier: GPL-3.0-or-later
"""Make library.csv, library_sources.csv and optical_constants.csv in addon/solver/physics from published optical
constants and spectra.

    python -m docs.tools.make_library <refractiveindex.info database> [<LUMA_SLUM_IR.csv>]

The first argument is the folder `database/data` of a clone of github.com/polyanskiy/refractiveindex.info-database
(CC0), the second the long-wave table of SLUM (doi.org/10.5281/zenodo.4263842). Neither is part of this project; what
is kept is the emissivity computed from them, and n and k at few wavelengths. The materials and how each is derived are
listed below. Without the second argument the rows of measured materials stay as they are.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from addon.solver.physics import library
from addon.solver.physics.fresnel import fresnel_reflectance
from docs.tools.paths import ROOT

PHYSICS = ROOT / "addon" / "solver" / "physics"

SHORTEST, LONGEST = 1.0, 25.0  # um, kept part of the spectrum
RANGE = 0.8, 30.0  # um, kept part of the optical constants
COSINES = np.cos(np.radians([0.0, 45.0, 65.0, 80.0, 87.0]))  # at which the kept constants give the emissivity
ABSOLUTE_ERROR = 0.0015  # of linear interpolation between the kept points
RELATIVE_ERROR = 0.02  # of the same, where emissivity is low (metals)
BANDS = (3.0, 5.0), (8.0, 14.0)  # um, where the notes give the depth in which a body absorbs

ORDAL_1985 = (
    "M. A. Ordal, R. J. Bell, R. W. Alexander, L. L. Long, M. R. Querry, Optical properties of fourteen metals in the "
    "infrared and far infrared, Appl. Opt. 24, 4493-4499 (1985), doi:10.1364/AO.24.004493"
)
ORDAL_1987 = (
    "M. A. Ordal, R. J. Bell, R. W. Alexander, L. L. Long, M. R. Querry, Optical properties of Au, Ni, and Pb at "
    "submillimeter wavelengths, Appl. Opt. 26, 744-752 (1987), doi:10.1364/AO.26.000744"
)
ORDAL_1988 = (
    "M. A. Ordal, R. J. Bell, R. W. Alexander, L. A. Newquist, M. R. Querry, Optical properties of Al, Fe, Ti, Ta, W, "
    "and Mo at submillimeter wavelengths, Appl. Opt. 27, 1203-1209 (1988), doi:10.1364/AO.27.001203"
)
RAKIC_1998 = (
    "A. D. Rakic, A. B. Djurisic, J. M. Elazar, M. L. Majewski, Optical properties of metallic films for "
    "vertical-cavity optoelectronic devices, Appl. Opt. 37, 5271-5283 (1998), doi:10.1364/AO.37.005271"
)
QUERRY_1985 = "M. R. Querry, Optical constants, Contractor Report CRDC-CR-85034 (1985), DTIC ADA158623"
QUERRY_1987 = (
    "M. R. Querry, Optical constants of minerals and other materials from the millimeter to the ultraviolet, "
    "Contractor Report CRDEC-CR-88009 (1987), DTIC ADA192210"
)
SYNOWICKI_2004 = (
    "R. A. Synowicki, T. E. Tiwald, Optical properties of bulk c-ZrO2, c-MgO and a-As2S3 determined by variable angle "
    "spectroscopic ellipsometry, Thin Solid Films 455-456, 248-255 (2004), doi:10.1016/j.tsf.2004.02.028"
)
ZHANG_2020 = (
    "X. Zhang, J. Qiu, J. Zhao, X. Li, L. Liu, Complex refractive indices measurements of polymers in infrared bands, "
    "J. Quant. Spectrosc. Radiat. Transf. 252, 107063 (2020), doi:10.1016/j.jqsrt.2020.107063 (2-20 um); the same "
    "authors, Appl. Opt. 59, 2337-2344 (2020), doi:10.1364/AO.383831 (below 2 um)"
)
KOTTHAUS_2014 = (
    "S. Kotthaus, T. E. L. Smith, M. J. Wooster, C. S. B. Grimmond, Derivation of an urban materials spectral library "
    "through emittance and reflectance spectroscopy, ISPRS J. Photogramm. Remote Sens. 94, 194-212 (2014), "
    "doi:10.1016/j.isprsjprs.2014.05.005; data: Spectral Library of Impervious Urban Materials 1.0, "
    "doi:10.5281/zenodo.4263842, sample {sample}"
)
OHMAN_1999 = (
    "C. Ohman, Emittance measurements using AGEMA E-Box, technical report, AGEMA (1999), as reference 9 of the "
    "emissivity tables in FLIR Systems user's manuals (Publ. No. 1558146, T559880, T810253), row '{row}'"
)

WEAK_K_NOTE = "Small k are crude in this source: how thick is opaque, above all in 3-5 um, is not known."

Points = tuple[np.ndarray, np.ndarray]  # wavelengths (n,) um, emissivities (n,)


@dataclass(frozen=True)
class Recipe:
    """How one material of the library is made.

    curve: called with the two paths of the command line, returns the points and what is to be said of their range.
    """

    name: str
    category: str
    kind: str
    curve: Callable[[Path, Path], tuple[Points, str]]
    source: str
    note: str


class Tabulated:
    """Emissivity of a body whose optical constants are known.

    constants: called with the database, returns wavelengths (um), n and k, (m,) each. noted: whether to tell how thick
    the body must be; a text instead is told itself.
    """

    def __init__(self, constants: Callable[[Path], tuple], noted: bool | str):
        self.constants, self._noted = constants, noted

    def __call__(self, database: Path, _slum: Path | None) -> tuple[Points, str]:
        wavelength, n, k = self.constants(database)
        note = self._noted if isinstance(self._noted, str) else absorption_note(wavelength, k) if self._noted else ""
        return (wavelength, normal_emissivity(n, k)), note


def normal_emissivity(n: np.ndarray, k: np.ndarray) -> np.ndarray:
    """1 - R for light that meets a smooth surface of an opaque body along its normal (Fresnel); n, k: (m,)."""
    return 4.0 * n / ((n + 1.0) ** 2 + k**2)


def read_constants(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Wavelength (um), n, k of a database file with one table of three columns."""
    rows = [line.split() for line in path.read_text(encoding="utf-8").splitlines()]
    table = np.array([row for row in rows if len(row) == 3 and all(map(_is_number, row))], dtype=np.float64)
    table = table[np.argsort(table[:, 0])]
    table = table[np.r_[True, np.diff(table[:, 0]) > 0]]
    return table[:, 0], table[:, 1], table[:, 2]


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def metal(path: str):
    """Emissivity of an opaque metal from one table of constants."""
    return Tabulated(lambda database: read_constants(database / f"{path}.yml"), noted=False)


def bulk(*paths: str):
    """Emissivity of a thick body, averaged over the principal rays `paths` of its crystal (one path: isotropic)."""
    if len(paths) == 1:
        return Tabulated(lambda database: read_constants(database / f"{paths[0]}.yml"), noted=True)

    def curve(database: Path, _slum: Path):
        return mean_of_rays([read_constants(database / f"{path}.yml") for path in paths])

    return curve


def bulk_of_crude_k(*paths: str):
    """As bulk, from tables whose small k cannot be trusted: their sapphire is opaque in 3-5 um, windows are not."""
    if len(paths) == 1:
        return Tabulated(lambda database: read_constants(database / f"{paths[0]}.yml"), noted=WEAK_K_NOTE)

    def curve(database: Path, slum_file: Path):
        points, _ = bulk(*paths)(database, slum_file)
        return (
            points,
            WEAK_K_NOTE,
        )

    return curve


def mean_of_rays(rays):
    """The mean curve of rays [(wavelength, n, k)], and the depth in which the body absorbs."""
    grid = rays[0][0]
    grid = grid[(grid >= max(ray[0][0] for ray in rays)) & (grid <= min(ray[0][-1] for ray in rays))]
    constants = [(np.interp(grid, w, n), np.interp(grid, w, k)) for w, n, k in rays]
    emissivity = np.mean([normal_emissivity(n, k) for n, k in constants], axis=0)
    return (grid, emissivity), absorption_note(grid, np.min([k for _, k in constants], axis=0))


def absorption_note(wavelength: np.ndarray, k: np.ndarray) -> str:
    """Within which thickness 99 % of the radiation is absorbed, at the most transparent wavelength of each band."""
    parts = []
    for low, high in BANDS:
        inside = (wavelength >= low) & (wavelength <= high)
        if np.any(inside):
            worst = np.max(np.log(100.0) * wavelength[inside] / (4.0 * np.pi * np.maximum(k[inside], 1e-12))) * 1e-3
            depth = f"{worst:.2g} mm" if worst < 100.0 else "more than 100 mm"
            parts.append(f"{depth} in {low:g}-{high:g} um")
    return "Opaque (absorbs 99 %) above a thickness of " + " and ".join(parts) + "." if parts else ""


def soda_lime(database: Path):
    """Rubin 1985: below 4.6 um n is a formula and k a table; from 5 um both are a table."""
    lines = (database / "glass/misc/soda-lime/nk/Rubin-clear.yml").read_text(encoding="utf-8").splitlines()
    pairs = [line.split() for line in lines if len(line.split()) == 2 and all(map(_is_number, line.split()))]
    wavelength, k = np.array(pairs, dtype=np.float64).T
    n = 1.5130 - 0.003169 * wavelength**2 + 0.003962 * wavelength**-2
    table = read_constants(database / "glass/misc/soda-lime/nk/Rubin-IR.yml")
    return tuple(np.concatenate(both) for both in zip((wavelength, n, k), table, strict=True))


def silicon_carbide(_database: Path):
    """One Lorentz oscillator; wavenumbers in 1/cm."""
    high, longitudinal, transverse, damping = 6.7, 969.0, 793.0, 4.76
    wavelength = np.linspace(2.0, LONGEST, 20001)
    wavenumber = 1e4 / wavelength
    epsilon = high * (
        1 + (longitudinal**2 - transverse**2) / (transverse**2 - wavenumber**2 - 1j * damping * wavenumber)
    )
    index = np.sqrt(epsilon)
    return wavelength, index.real, index.imag


def slum(sample: str):
    """A measured spectrum of the urban library, 8-14 um."""

    def curve(_database: Path, slum_file: Path):
        with slum_file.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        wavelength = np.array([float(row["wavelength"]) for row in rows])
        emissivity = np.array([float(row[sample]) for row in rows])
        return (wavelength, np.clip(emissivity, 0.0, 1.0)), "8-14 um only: held constant below 8 um and above 14 um."

    return curve


def given(*points: tuple[float, float]):
    """Points written here as they stand in the source."""

    def curve(_database: Path, _slum: Path):
        return tuple(np.array(points).T), ""

    return curve


def two_bands(short: float, long: float):
    """Values of the bands 2-5 um and 8-14 um."""
    return given((2.0, short), (5.0, short), (8.0, long), (14.0, long))


def simplify(wavelength: np.ndarray, emissivity: np.ndarray) -> np.ndarray:
    """Fewest points by bisection (Ramer, Douglas, Peucker) with the errors of linear interpolation bounded.

    The range is cut to SHORTEST..LONGEST. Returns (n, 2).
    """
    x = within(wavelength, (SHORTEST, LONGEST))
    y = np.interp(x, wavelength, emissivity)
    chosen = kept_points(x, y[:, None])
    return np.column_stack([x[chosen], y[chosen]])


def simplify_constants(wavelength: np.ndarray, n: np.ndarray, k: np.ndarray) -> np.ndarray:
    """As simplify, for the emissivity at all of COSINES, cut to RANGE. Returns (n, 3): um, n, k."""
    x = within(wavelength, RANGE)
    n, k = np.interp(x, wavelength, n), np.interp(x, wavelength, np.maximum(k, 0.0))  # one source has -0.002
    chosen = kept_points(x, 1.0 - fresnel_reflectance(n[:, None], k[:, None], COSINES))
    return np.column_stack([x[chosen], n[chosen], k[chosen]])


def within(wavelength: np.ndarray, limits: tuple[float, float]) -> np.ndarray:
    """The wavelengths between two limits, and the limits themselves as far as they are inside."""
    ends = max(limits[0], wavelength[0]), min(limits[1], wavelength[-1])
    return np.concatenate([ends[:1], wavelength[(wavelength > ends[0]) & (wavelength < ends[1])], ends[1:]])


def kept_points(x: np.ndarray, y: np.ndarray) -> list[int]:
    """Indices of the points to keep of (m, c) emissivities y over x (m,)."""
    keep = {0, len(x) - 1}
    spans = [(0, len(x) - 1)]
    while spans:
        first, last = spans.pop()
        inner = slice(first + 1, last)
        if last - first < 2:
            continue
        share = ((x[inner] - x[first]) / (x[last] - x[first]))[:, None]
        line = y[first] + share * (y[last] - y[first])
        allowed = np.minimum(ABSOLUTE_ERROR, RELATIVE_ERROR * y[inner] + 1e-9)
        excess = np.max(np.abs(line - y[inner]) / allowed, axis=1)
        worst = first + 1 + int(np.argmax(excess))
        if excess[worst - first - 1] > 1.0:
            keep.add(worst)
            spans += [(first, worst), (worst, last)]
    return sorted(keep)


POLISHED = "Clean, smooth, bare metal. Roughness, oxide and dirt raise it."
FILM = "Clean, smooth evaporated film. Roughness and dirt raise it."
SMOOTH = "Smooth surface."
POLYCRYSTAL = "Smooth polycrystal: mean over the principal rays."
ORIENTED_MEAN = "Smooth surface: mean of two ordinary rays and one extraordinary ray (random orientation)."
TRANSPARENT = (
    "Lets most infrared through, which the engine does not show: right in what it mirrors, too warm in what it emits."
)
PLASTIC = "Smooth, unfilled, without pigment."
SLUM_NOTE = "FTIR emission spectrum of one sample."
BAND_NOTE = "Mean emissivity of the bands 2-5 um and 8-14 um at 70 deg C, joined by a straight line between 5 and 8 um."

RECIPES = [
    Recipe("Aluminium, polished", "metal", "computed", metal("main/Al/nk/Ordal"), ORDAL_1988, POLISHED),
    Recipe("Brass, polished", "metal", "computed", metal("other/alloys/Cu-Zn/nk/Querry-Cu70Zn30"), QUERRY_1985,
           "70 % copper, 30 % zinc. " + POLISHED),
    Recipe("Chromium, polished", "metal", "computed", metal("main/Cr/nk/Rakic-BB"), RAKIC_1998,
           "Brendel-Bormann model. " + FILM),
    Recipe("Copper, polished", "metal", "computed", metal("main/Cu/nk/Ordal"), ORDAL_1985, POLISHED),
    Recipe("Gold, polished", "metal", "computed", metal("main/Au/nk/Olmon-ev"),
           "R. L. Olmon, B. Slovick, T. W. Johnson, D. Shelton, S.-H. Oh, G. D. Boreman, M. B. Raschke, Optical "
           "dielectric function of gold, Phys. Rev. B 86, 235147 (2012), doi:10.1103/PhysRevB.86.235147", FILM),
    Recipe("Iron, polished", "metal", "computed", metal("main/Fe/nk/Ordal"), ORDAL_1988,
           "Also the nearest to polished plain steel. " + POLISHED),
    Recipe("Lead, polished", "metal", "computed", metal("main/Pb/nk/Ordal"), ORDAL_1987, POLISHED),
    Recipe("Nickel, polished", "metal", "computed", metal("main/Ni/nk/Ordal"), ORDAL_1987, POLISHED),
    Recipe("Platinum, polished", "metal", "computed", metal("main/Pt/nk/Rakic-BB"), RAKIC_1998,
           "Brendel-Bormann model. " + FILM),
    Recipe("Silver, polished", "metal", "computed", metal("main/Ag/nk/Yang"),
           "H. U. Yang, J. D'Archangel, M. L. Sundheimer, E. Tucker, G. D. Boreman, M. B. Raschke, Optical dielectric "
           "function of silver, Phys. Rev. B 91, 235137 (2015), doi:10.1103/PhysRevB.91.235137",
           "Template-stripped film, very smooth. Tarnish raises it."),
    Recipe("Titanium, polished", "metal", "computed", metal("main/Ti/nk/Ordal"), ORDAL_1988, POLISHED),
    Recipe("Tungsten, polished", "metal", "computed", metal("main/W/nk/Ordal"), ORDAL_1988,
           "At room temperature; a glowing filament emits more. " + POLISHED),
    Recipe("Zinc, polished", "metal", "computed", metal("main/Zn/nk/Querry"), QUERRY_1987, POLISHED),
    Recipe("Aluminium, anodised black", "metal surface", "band", two_bands(0.67, 0.95),
           OHMAN_1999.format(row="Aluminum, anodized, black, dull"), BAND_NOTE),
    Recipe("Aluminium, anodised grey", "metal surface", "band", two_bands(0.61, 0.97),
           OHMAN_1999.format(row="Aluminum, anodized, light gray, dull"), BAND_NOTE),
    Recipe("Aluminium, stucco sheet", "metal surface", "measured", slum("Z002"), KOTTHAUS_2014.format(sample="Z002"),
           "New shiny embossed sheet. " + SLUM_NOTE),
    Recipe("Aluminium, weathered", "metal surface", "measured", slum("Z006"), KOTTHAUS_2014.format(sample="Z006"),
           "Grey sheet. " + SLUM_NOTE),
    Recipe("Iron, weathered", "metal surface", "measured", slum("Z008"), KOTTHAUS_2014.format(sample="Z008"),
           "Black. " + SLUM_NOTE),
    Recipe("Lead, weathered", "metal surface", "measured", slum("Z007"), KOTTHAUS_2014.format(sample="Z007"),
           "Grey sheet. " + SLUM_NOTE),
    Recipe("Steel, cold rolled", "metal surface", "band", two_bands(0.20, 0.09),
           OHMAN_1999.format(row="Iron and steel, cold rolled"), BAND_NOTE),
    Recipe("Steel, galvanised, heavily oxidised", "metal surface", "band", two_bands(0.64, 0.85),
           OHMAN_1999.format(row="Iron galvanized, heavily oxidized"), BAND_NOTE),
    Recipe("Paint, dark green on metal", "coating", "measured", slum("Z003"), KOTTHAUS_2014.format(sample="Z003"),
           "New painted sheet. " + SLUM_NOTE),
    Recipe("Paint, lacquer on aluminium", "coating", "band", two_bands(0.515, 0.93),
           OHMAN_1999.format(row="Lacquer, 3 colors sprayed on aluminum"),
           "The source gives 0.50-0.53 and 0.92-0.94; the middle is used. " + BAND_NOTE),
    Recipe("Paint, ultra-flat black", "coating", "band", given((3.0, 0.97), (5.0, 0.97), (8.0, 0.96), (14.0, 0.96)),
           "ITC Technical publication 32, as reference 12 of the emissivity tables in the FLIR Systems user's manual "
           "Publ. No. T559880, rows 'Krylon Ultra-flat black 1602'",
           "Mean emissivity in the mid-wave (taken as 3-5 um) and long-wave (8-14 um) bands, room temperature to 175 "
           "deg C, joined by a straight line between 5 and 8 um."),
    Recipe("Soot", "carbon", "computed", bulk("other/soots/diesel soot/nk/Querry-NMSU"), QUERRY_1987,
           "Pressed pellet of soot from open burning of diesel fuel; loose soot is rougher and blacker."),
    Recipe("Graphite", "carbon", "computed", bulk("main/C/nk/Querry-DixonKS2"), QUERRY_1985,
           "Pressed pellet of Dixon KS-2 powder, smooth; rough graphite is blacker."),
    Recipe("Water", "water", "computed", bulk("main/H2O/nk/Hale"),
           "G. M. Hale, M. R. Querry, Optical constants of water in the 200-nm to 200-um wavelength region, Appl. Opt. "
           "12, 555-563 (1973), doi:10.1364/AO.12.000555", "Liquid at 25 deg C, calm surface."),
    Recipe("Ice", "water", "computed", bulk("main/H2O/nk/Warren-2008"),
           "S. G. Warren, R. E. Brandt, Optical constants of ice from the ultraviolet to the microwave: a revised "
           "compilation, J. Geophys. Res. 113, D14220 (2008), doi:10.1029/2007JD009744",
           "Smooth bare ice at -7 deg C."),
    Recipe("Snow, coarse-grained", "water", "measured", given((11.0, 0.990), (12.0, 0.975)),
           "Possibility to discriminate snow types using brightness temperatures in the thermal "
           "infrared wavelength region, AIP Conf. Proc. 1531, 316 (2013), abstract",
           "Two points, measured in the field along the normal; held constant below 11 um and above 12 um."),
    Recipe("Skin, human", "living", "measured", given((3.0, 0.98), (14.0, 0.98)),
           "J. Steketee, Spectral emissivity of skin and pericardium, Phys. Med. Biol. 18, 686-694 (1973), "
           "doi:10.1088/0031-9155/18/5/307",
           "Found independent of wavelength and of skin colour, 0.98 +- 0.01. Kept from 3 um: nearer the visible skin "
           "reflects."),
    Recipe("Glass, window", "glass", "computed", Tabulated(soda_lime, noted=True),
           "M. Rubin, Optical properties of soda lime silica glasses, Sol. Energy Mater. 12, 275-288 (1985), "
           "doi:10.1016/0165-1633(85)90052-8", "Clear soda-lime float glass without coating."),
    Recipe("Fused silica", "glass", "computed", bulk("main/SiO2/nk/Franta"),
           "D. Franta, D. Necas, I. Ohlidal, A. Giglia, Optical characterization of SiO2 thin films using universal "
           "dispersion model over wide spectral range, Proc. SPIE 9890, 989014 (2016), doi:10.1117/12.2227580",
           "Polished plate."),
    Recipe("Alumina", "ceramic", "computed",
           bulk_of_crude_k(*(f"main/Al2O3/nk/Querry-{ray}" for ray in "ooe")), QUERRY_1985,
           "Sapphire constants. " + ORIENTED_MEAN),
    Recipe("Magnesia", "ceramic", "computed", bulk("main/MgO/nk/Synowicki"), SYNOWICKI_2004, SMOOTH),
    Recipe("Silicon carbide", "ceramic", "computed", Tabulated(silicon_carbide, noted=True),
           "W. J. Choyke, E. D. Palik, Silicon carbide (SiC), in Handbook of Optical Constants of Solids, Academic "
           "Press (1985), p. 588: Lorentz oscillator with eps_inf 6.7, LO 969, TO 793, damping 4.76 1/cm", SMOOTH),
    Recipe("Zirconia", "ceramic", "computed", bulk("main/ZrO2/nk/Synowicki"), SYNOWICKI_2004,
           "Cubic. " + SMOOTH),
    Recipe("Copper oxide, cuprous", "oxide", "computed", bulk_of_crude_k("main/Cu2O/nk/Querry"), QUERRY_1985,
           "Pressed pellet: the thick red oxide of copper."),
    Recipe("Hematite", "oxide", "computed",
           bulk_of_crude_k(*(f"main/Fe2O3/nk/Querry-{ray}" for ray in "ooe")), QUERRY_1985,
           "Red iron oxide, the end product of rust. " + ORIENTED_MEAN + " Powdery rust is rougher and blacker."),
    Recipe("Magnetite", "oxide", "computed", bulk("main/Fe3O4/nk/Querry"), QUERRY_1985,
           "Black iron oxide, a main part of mill scale. " + SMOOTH),
    Recipe("Zinc oxide", "oxide", "computed", bulk_of_crude_k("main/ZnO/nk/Querry"), QUERRY_1985, "Pressed pellet."),
    Recipe("Germanium", "semiconductor", "computed", bulk("main/Ge/nk/Amotchkina"),
           "T. Amotchkina, M. Trubetskov, D. Hahner, V. Pervak, Characterization of e-beam evaporated Ge, YbF3, ZnS, "
           "and LaF3 thin films for laser-oriented coatings, Appl. Opt. 59, A40-A47 (2020), doi:10.1364/AO.59.000A40",
           "Polished substrate. " + TRANSPARENT),
    Recipe("Silicon", "semiconductor", "computed", bulk("main/Si/nk/Franta-300K"),
           "D. Franta, A. Dubroka, C. Wang, A. Giglia, J. Vohanka, P. Franta, I. Ohlidal, Temperature-dependent "
           "dispersion model of float zone crystalline silicon, Appl. Surf. Sci. 421, 405-419 (2017), "
           "doi:10.1016/j.apsusc.2017.02.021", "Polished float-zone wafer at 300 K. " + TRANSPARENT),
    Recipe("Anhydrite", "mineral", "computed",
           bulk_of_crude_k(*(f"main/CaSO4/nk/Querry-{axis}" for axis in ("alpha", "beta", "gamma"))), QUERRY_1987,
           "Calcium sulfate; the constants have no water bands, so not gypsum. " + POLYCRYSTAL),
    Recipe("Dolomite", "mineral", "computed",
           bulk_of_crude_k(*(f"main/CaMg(CO3)2/nk/Querry-{ray}" for ray in "ooe")), QUERRY_1987,
           "Carbonate rock. " + ORIENTED_MEAN),
    Recipe("Kaolinite", "mineral", "computed", bulk_of_crude_k("other/clays/kaolinite/nk/Querry"), QUERRY_1987,
           "White clay, pressed pellet; dry earth is rougher and blacker."),
    Recipe("Montmorillonite", "mineral", "computed", bulk_of_crude_k("other/clays/montmorillonite/nk/Querry"),
           QUERRY_1987, "Swelling clay, pressed pellet; dry earth is rougher and blacker."),
    Recipe("Plastic, PET", "polymer", "computed", bulk("organic/(C10H8O4)n - polyethylene terephthalate/nk/Zhang"),
           ZHANG_2020, PLASTIC),
    Recipe("Plastic, PMMA (acrylic)", "polymer", "computed",
           bulk("organic/(C5H8O2)n - poly(methyl methacrylate)/nk/Zhang-Mitsubishi"), ZHANG_2020, PLASTIC),
    Recipe("Plastic, polycarbonate", "polymer", "computed", bulk("organic/(C16H14O3)n - polycarbonate/nk/Zhang"),
           ZHANG_2020, PLASTIC),
    Recipe("Plastic, polyimide", "polymer", "computed", bulk("other/commercial polymers/Kapton/nk/Zhang"),
           "Z. M. Zhang, G. Lefever-Button, F. R. Powell, Infrared refractive index and extinction coefficient of "
           "polyimide films, Int. J. Thermophys. 19, 905-916 (1998), doi:10.1023/A:1022655309574",
           "Lorentz model. " + PLASTIC),
    Recipe("Plastic, polystyrene", "polymer", "computed", bulk("organic/(C8H8)n - polystyrene/nk/Zhang"), ZHANG_2020,
           PLASTIC),
    Recipe("Plastic, PVC", "polymer", "computed", bulk("organic/(C2H3Cl)n - polyvinyl chloride/nk/Zhang"), ZHANG_2020,
           PLASTIC),
    Recipe("Silicone rubber (PDMS)", "polymer", "computed",
           bulk("organic/(C2H6OSi)n - polydimethylsiloxane/nk/Zhang-10-1"), ZHANG_2020, "Cured 10:1. " + PLASTIC),
    Recipe("Roofing sheet, PVC grey", "building", "measured", slum("V001"), KOTTHAUS_2014.format(sample="V001"),
           "New. " + SLUM_NOTE),
    Recipe("Asphalt, road", "building", "measured", slum("A001"), KOTTHAUS_2014.format(sample="A001"),
           "Weathered, with stone aggregate. " + SLUM_NOTE),
    Recipe("Brick, new", "building", "measured", slum("B008"), KOTTHAUS_2014.format(sample="B008"),
           "Light red ceramic brick. " + SLUM_NOTE),
    Recipe("Brick, weathered", "building", "measured", slum("B013"), KOTTHAUS_2014.format(sample="B013"),
           "Red ceramic brick. " + SLUM_NOTE),
    Recipe("Concrete, new", "building", "measured", slum("C002"), KOTTHAUS_2014.format(sample="C002"),
           "Grey and white. " + SLUM_NOTE),
    Recipe("Concrete, weathered", "building", "measured", slum("C004"), KOTTHAUS_2014.format(sample="C004"),
           "Grey. " + SLUM_NOTE),
    Recipe("Granite", "building", "measured", slum("G001"), KOTTHAUS_2014.format(sample="G001"),
           "New, rough, white and black. " + SLUM_NOTE),
    Recipe("Limestone", "building", "measured", slum("S004"), KOTTHAUS_2014.format(sample="S004"),
           "Beige, weathered. " + SLUM_NOTE),
    Recipe("Roof tile, ceramic", "building", "measured", slum("R010"), KOTTHAUS_2014.format(sample="R010"),
           "Red, weathered. " + SLUM_NOTE),
    Recipe("Sandstone", "building", "measured", slum("S001"), KOTTHAUS_2014.format(sample="S001"),
           "Beige. " + SLUM_NOTE),
]  # fmt: skip


def main(database: Path, slum_file: Path | None) -> None:
    known = {} if slum_file else library.load()
    with (
        (PHYSICS / "library.csv").open("w", newline="", encoding="utf-8") as points_file,
        (PHYSICS / "library_sources.csv").open("w", newline="", encoding="utf-8") as sources_file,
        library.CONSTANTS_FILE.open("w", newline="", encoding="utf-8") as constants_file,
    ):
        points_table, sources_table, constants = map(csv.writer, (points_file, sources_file, constants_file))
        points_table.writerow(library.POINTS_HEADER)
        sources_table.writerow(library.SOURCES_HEADER)
        constants.writerow(library.CONSTANTS_HEADER)
        for recipe in RECIPES:
            if recipe.kind != "measured" or slum_file:
                (wavelength, emissivity), range_note = recipe.curve(database, slum_file)
                points, note = simplify(wavelength, emissivity), f"{recipe.note} {range_note}".strip()
            else:
                points, note = known[recipe.name].points, known[recipe.name].note
            points_table.writerows([recipe.name, f"{x:.6g}", f"{y:.4f}"] for x, y in points)
            sources_table.writerow([recipe.name, recipe.category, recipe.kind, recipe.source, note])
            if isinstance(recipe.curve, Tabulated):
                kept = simplify_constants(*recipe.curve.constants(database))
                constants.writerows([recipe.name, *(f"{value:.6g}" for value in row)] for row in kept)


if __name__ == "__main__":
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    main(*map(Path, sys.argv[1:]), *[None] * (3 - len(sys.argv)))
