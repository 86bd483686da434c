# SPDX-License-Identifier: GPL-3.0-or-later
"""scene.infrared, and the custom properties that give objects, materials, worlds and lights their physics.

Numbers have soft limits where a value outside is an error: a script's mistake is reported, not silently clamped.
The defaults of the solver's settings are written out here as users read them; a test compares them with the solver's.
"""

from __future__ import annotations

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from .heat_settings import HeatDisplaySettings, InfraredSpot
from .interface import TEMPERATURE_DIGITS, temperature_property
from .measure_settings import MeasureSettings
from .object_settings import ROOM_TEMPERATURE, ObjectParameterSettings
from .output.formats import ENUM_ITEMS
from .solver.scene import ATMOSPHERE, LAMP_TEMPERATURE, SUN_TEMPERATURE

# Spectral responses: key, name, description and number of each
SENSORS = (
    ("BOX", "Ideal", "All wavelengths in the bands count alike", 0),
    ("INSB", "InSb", "Cooled indium antimonide: 1 to 5.5 µm, for bands from 3 to 5 µm", 1),
    ("HGCDTE", "HgCdTe", "Cooled mercury cadmium telluride: up to 10.8 µm, for bands from 8 to 11 µm", 2),
    ("MICROBOLOMETER", "Microbolometer", "Uncooled vanadium oxide: 7.5 to 13.5 µm", 3),
    ("CUSTOM", "Custom", "The scene's custom property 'sensor_response', which an import sets", 4),
)

# Custom property -> what Blender's interface shows of it. The limits are soft for the reason above.
CUSTOM_PROPERTIES = {
    "temperature": {
        "subtype": "TEMPERATURE",
        "soft_min": 0.0,
        "soft_max": 2000.0,
        "step": 100.0,
        "precision": TEMPERATURE_DIGITS,
        "description": "Temperature in kelvin",
    },
    "emissivity": {
        "subtype": "FACTOR",
        "soft_min": 0.0,
        "soft_max": 1.0,
        "precision": 3,
        "description": "Share of a blackbody's radiation that the surface emits, 0 to 1; it reflects the rest",
    },
    "specular": {
        "subtype": "FACTOR",
        "soft_min": 0.0,
        "soft_max": 1.0,
        "precision": 3,
        "description": "Share of the reflected radiation that is mirrored instead of scattered, 0 to 1",
    },
    "roughness": {
        "subtype": "FACTOR",
        "soft_min": 0.0,
        "soft_max": 1.0,
        "precision": 3,
        "description": "Roughness of the mirrored share: 0 is a perfect mirror, 1 the widest gloss",
    },
    "fresnel": {
        "description": "Fresnel's law: the mirrored share grows towards grazing angles, as on water, glass and gloss "
        "paint, and the emission falls. Emissivity and Specular are those seen straight on. Library materials with "
        "optical constants follow these",
    },
    "transmittance": {
        "subtype": "FACTOR",
        "soft_min": 0.0,
        "soft_max": 1.0,
        "precision": 3,
        "description": "Share of what meets a thin sheet that passes straight through, 0 to 1, from both sides alike: "
        "film, cloth, mesh wire. With the emissivity it is at most 1; the rest is reflected",
    },
    "mix": {
        "subtype": "FACTOR",
        "soft_min": 0.0,
        "soft_max": 1.0,
        "precision": 3,
        "description": "How much of the other material there is in place of this one, 0 to 1",
    },
    "mix_material": {"description": "The material that there is in part in place of this one"},
    "absorption": {
        "soft_min": 0.0,
        "soft_max": 100.0,
        "precision": 4,
        "description": "Absorption coefficient of a gas, 1/m: a metre absorbs the share 1 - exp(-absorption). "
        "With it the material fills closed meshes instead of covering their surface",
    },
    "scattering": {
        "soft_min": 0.0,
        "soft_max": 100.0,
        "precision": 4,
        "description": "Scattering coefficient of a gas with droplets or particles, 1/m. "
        "With it the material fills closed meshes instead of covering their surface",
    },
    "anisotropy": {
        "soft_min": -1.0,
        "soft_max": 1.0,
        "precision": 3,
        "description": "Mean cosine of the angle by which the gas deflects light: 1 is onwards, 0 evenly, -1 back",
    },
    "depth": {
        "soft_min": 0.0,
        "soft_max": 1e5,
        "precision": 1,
        "description": "How far the gas of the world reaches along rays that leave the scene, m",
    },
    "gas": {
        "description": "What a gas consists of: the name of a mixture of the library, or mole fractions by species. "
        "With it the material fills closed meshes instead of covering their surface",
    },
    "pressure": {
        "soft_min": 1.0,
        "soft_max": 1e7,
        "precision": 1,
        "description": "Pressure of the gas that fills the mesh, or the world, in pascals",
    },
    "temperature_image": {
        "description": "Equirectangular image of the sky's temperatures: of a float image in kelvin, or with "
        "temperature_range = [low, high] what 0 and 1 mean. It wins over the temperature",
    },
    "temperature_table": {
        "description": "The sky's temperatures over zenith angle and wavelength, lists zenith (degrees), wavelength "
        "(um) and kelvin. It wins over the temperature",
    },
    "temperature_group": {
        "description": "Name of a group whose light a render keeps apart, so that it takes new temperatures "
        "afterwards. All in a group have one temperature; empty is none",
    },
}


def property_label(key: str) -> str:
    """A custom property's name as the interface shows it."""
    return key.replace("_", " ").title()


def initial_value(id_block, key: str, scene) -> float | str | bool:
    """The value that counts while a custom property is missing, so that adding it changes no image."""
    if key == "temperature_group":
        return ""
    if key == "fresnel":
        return False
    if key == "pressure":
        return ATMOSPHERE
    if key == "emissivity":
        return scene.infrared.default_emissivity
    if key != "temperature":
        return 0.0
    if isinstance(id_block, bpy.types.World):
        return 0.0
    if id_block.type == "LIGHT":
        return SUN_TEMPERATURE if id_block.data.type == "SUN" else LAMP_TEMPERATURE
    return scene.infrared.ambient_temperature


def set_custom_property(id_block, key: str, value: float | str | bool | list[float]) -> None:
    """Set the custom property `key`, whatever it was before.

    Where library overrides may change a property, Blender refuses values of another type or length, so the property is
    removed first. In a library override Blender only keeps, in the file, properties that are marked as overridable.
    """
    try:
        id_block[key] = value
    except TypeError:
        del id_block[key]
        id_block[key] = value
    if id_block.override_library is not None:
        id_block.property_overridable_library_set(f'["{key}"]', True)


def add_custom_property(id_block, key: str, value: float | str | bool) -> None:
    """Set the custom property `key` to a number, a text, or yes or no, with its unit and tooltip.

    It is marked as one that library overrides may change. Not so the emissivity, the transmittance and the mix: the
    mark would fix their type to a number, and they may also become a curve, a name or an image.
    """
    set_custom_property(id_block, key, value if isinstance(value, str | bool) else float(value))
    shown = dict(CUSTOM_PROPERTIES[key])
    if key == "temperature" and isinstance(id_block, bpy.types.Object) and id_block.type != "LIGHT":
        shown["description"] += ". A mesh attribute named 'temperature' wins over it"
    id_block.id_properties_ui(key).update(default=id_block[key], **shown)
    if key not in ("emissivity", "transmittance", "mix"):
        id_block.property_overridable_library_set(f'["{key}"]', True)


def show_passes(settings, _context) -> None:
    """Let the compositor's nodes show the passes that the settings ask for."""
    for layer in settings.id_data.view_layers:
        layer.update_render_passes()


class InfraredSettings(HeatDisplaySettings, ObjectParameterSettings, MeasureSettings, bpy.types.PropertyGroup):
    """Settings of the Infrared Photons engine, one set in every scene."""

    passes: IntProperty(
        name="Passes",
        description="Number of passes; the image is their mean. 0 renders until the time or the noise limit is reached",
        default=32,
        min=0,
        soft_max=10_000,
    )
    photons_per_pass: IntProperty(
        name="Photons per Pass",
        description="Photons traced in each pass. More give less noise and less blur, and need more memory",
        default=100_000,
        min=1,
        soft_min=1_000,
        soft_max=10_000_000,
    )
    neighbours: IntProperty(
        name="Neighbours",
        description="Photons gathered for one radiance estimate: many for less noise, few for sharper light patterns",
        default=50,
        min=2,
        soft_max=1_000,
    )
    seed: IntProperty(
        name="Seed",
        description="Start of all random numbers; the same seed gives the same image",
        default=0,
        min=0,
    )
    threads: IntProperty(
        name="Threads",
        description="Processor threads; 0 uses all. The image does not depend on it",
        default=0,
        min=0,
        soft_max=64,
    )
    pass_offset: IntProperty(
        name="First Pass",
        description="Index of the first pass, to resume a render or to share its passes between machines",
        default=0,
        min=0,
    )
    time_limit: FloatProperty(
        name="Time Limit",
        description="Stop after this many seconds for each view layer, counted from the start of the first pass, which "
        "is always finished; 0 is no limit",
        default=0.0,
        min=0.0,
        soft_max=86_400.0,
        subtype="TIME_ABSOLUTE",
        unit="TIME_ABSOLUTE",
    )
    target_noise: FloatProperty(
        name="Target Noise (K)",
        description="Stop when the standard error of the temperature is below this many kelvin in 95 % of the pixels; "
        "looked at after 8 passes, and again each time their number has grown by a tenth. 0 is no limit",
        default=0.0,
        min=0.0,
        soft_max=10.0,
        precision=3,
    )
    reference_subtraction: BoolProperty(
        name="Reference Subtraction",
        description="Trace only the difference to a scene at one temperature: far less noise, the same mean",
        default=True,
    )
    roulette: EnumProperty(
        name="Roulette",
        description="How a photon's survival of a reflection is decided",
        items=(
            ("POWER", "Power Weighted", "Keep a photon's total power over all bands: bounded weights", 0),
            ("BAND_AVERAGE", "Band Average", "Survive with the reflectance averaged over the bands (Boudet 2004)", 1),
        ),
        default="POWER",
    )
    shrink: BoolProperty(
        name="Shrinking Radius",
        description="Gather photons from ever smaller disks, so that the image converges to the truth, not to a blur",
        default=True,
    )
    band_mode: EnumProperty(
        name="Bands",
        description="How the spectrum is divided into bands; each becomes one image",
        items=(
            ("UNIFORM", "Uniform", "Bands of equal width between two wavelengths", 0),
            ("ADAPTIVE", "Adaptive", "Narrow bands where the scene's spectra change, wide ones elsewhere", 2),
            ("CUSTOM", "Custom", "Bands between the edges you list", 1),
        ),
        default="UNIFORM",
        update=show_passes,
    )
    wavelength_min: FloatProperty(
        name="Shortest (µm)",
        description="Lower end of the spectrum in micrometres",
        default=7.5,
        soft_min=0.1,
        soft_max=100.0,
        precision=3,
        update=show_passes,
    )
    wavelength_max: FloatProperty(
        name="Longest (µm)",
        description="Upper end of the spectrum in micrometres",
        default=14.0,
        soft_min=0.1,
        soft_max=1_000.0,
        precision=3,
        update=show_passes,
    )
    band_count: IntProperty(
        name="Band Count",
        description="Number of bands",
        default=16,
        min=1,
        soft_max=256,
        update=show_passes,
    )
    band_tolerance: FloatProperty(
        name="Tolerance (K)",
        description="Take as few bands as keep what they lose in reflections below this many kelvin, foreseen from the "
        "scene's materials and temperatures; 0 takes Band Count",
        default=0.0,
        min=0.0,
        soft_max=1.0,
        precision=3,
        update=show_passes,
    )
    band_edges: StringProperty(
        name="Edges (µm)",
        description="Band edges in micrometres, ascending, separated by commas",
        default="3, 5, 8, 10, 12, 14",
        update=show_passes,
    )
    sensor: EnumProperty(
        name="Sensor",
        description="Spectral response of the camera, by which bands count in Radiance and Temperature",
        items=SENSORS,
        default="BOX",
    )
    sensor_lag: FloatProperty(
        name="Time Constant (ms)",
        description="Time in milliseconds in which the sensor follows a change of what it sees to 63 %, as a "
        "microbolometer does in 7 to 12 ms: pictures show an exponentially weighted mean of the past; 0 is at once",
        default=0.0,
        soft_min=0.0,
        soft_max=100.0,
        precision=2,
    )
    motion_steps: IntProperty(
        name="Steps",
        description="Number of times between which passes are shared out when things move: the scene is read at each "
        "of them before the first pass. Few steps show as copies of what moves fast",
        default=32,
        min=1,
        soft_max=256,
    )
    use_detector: BoolProperty(
        name="Camera Effects",
        description="Deliver the passes Camera Signal and Camera Temperature, with what a real camera's optics and "
        "detector add; the other passes stay as they are",
        default=False,
        update=show_passes,
    )
    detector_f_number: FloatProperty(
        name="F-Number",
        description="Of the optics, whose diffraction blurs long waves more than short ones; 0 is without diffraction",
        default=1.0,
        soft_min=0.0,
        soft_max=16.0,
        precision=2,
    )
    detector_pitch: FloatProperty(
        name="Pixel Pitch (µm)",
        description="Distance in micrometres of the detector's pixels, at a resolution of 100 %; 0 divides the "
        "camera's sensor size by the resolution",
        default=0.0,
        soft_min=0.0,
        soft_max=100.0,
        precision=2,
    )
    detector_fill_factor: FloatProperty(
        name="Fill Factor",
        description="Share of a pixel's area that detects, above 0 to 1; a smaller one is a little sharper",
        default=1.0,
        soft_min=0.1,
        soft_max=1.0,
        precision=2,
        subtype="FACTOR",
    )
    detector_netd: FloatProperty(
        name="NETD (K)",
        description="Noise equivalent temperature difference: standard deviation, in kelvin, of a pixel from frame to "
        "frame in front of a blackbody at 300 K; 0 is no noise",
        default=0.05,
        soft_min=0.0,
        soft_max=1.0,
        precision=3,
    )
    detector_photon_noise: BoolProperty(
        name="Photon Noise",
        description="The noise grows with the square root of the signal, as in cooled photon detectors; else it is "
        "the same everywhere, as in microbolometers",
        default=False,
    )
    detector_gain_spread: FloatProperty(
        name="Gain Spread",
        description="Standard deviation of the pixels' gains, 0.001 is a thousandth, the same in all frames; 0 is none",
        default=0.0002,
        soft_min=0.0,
        soft_max=0.1,
        precision=4,
        step=0.01,
    )
    detector_offset_spread: FloatProperty(
        name="Offset Spread (K)",
        description="Standard deviation of the pixels' offsets, in kelvin in front of a blackbody at 300 K, the same "
        "in all frames; 0 is none",
        default=0.02,
        soft_min=0.0,
        soft_max=1.0,
        precision=3,
    )
    detector_seed: IntProperty(
        name="Camera Seed",
        description="Start of the random numbers of the camera: another number is another camera with other pixels",
        default=0,
        min=0,
    )
    detector_bits: IntProperty(
        name="Bits",
        description="Of the digital numbers that Camera Signal then holds, between the lowest and the highest "
        "temperature; 0 leaves radiance",
        default=14,
        min=0,
        soft_max=16,
    )
    detector_low: temperature_property(
        "Lowest",
        "Temperature in kelvin of the blackbody whose signal is the digital number 0; what is colder is clipped",
        233.15,
        soft_min=0.0,
        soft_max=2_000.0,
        step=100,
    )
    detector_high: temperature_property(
        "Highest",
        "Temperature in kelvin of the blackbody whose signal is the largest digital number; what is hotter is clipped",
        423.15,
        soft_min=0.0,
        soft_max=2_000.0,
        step=100,
    )
    ambient_temperature: temperature_property(
        "Ambient",
        "Temperature in kelvin of objects that have none of their own",
        ROOM_TEMPERATURE,
        soft_min=0.0,
        soft_max=2_000.0,
        step=100,
    )
    default_emissivity: FloatProperty(
        name="Emissivity",
        description="Emissivity, 0 to 1, of materials that have none of their own and of faces without a material",
        default=0.95,
        soft_min=0.0,
        soft_max=1.0,
        precision=3,
        subtype="FACTOR",
    )
    use_surface_temperature: BoolProperty(
        name="Surface Temperature",
        description="Deliver a pass of the temperature, in kelvin, that the surface in the middle of each pixel has",
        default=False,
        update=show_passes,
    )
    use_emissivity: BoolProperty(
        name="Emissivity",
        description="Deliver a pass of the emissivity, 0 to 1, of the surface in the middle of each pixel: towards the "
        "camera, over all bands as the sensor sees them",
        default=False,
        update=show_passes,
    )
    use_transmittance: BoolProperty(
        name="Transmittance",
        description="Deliver a pass of the share, 0 to 1, that gas lets through between the camera and the surface in "
        "the middle of each pixel, or the surroundings: over all bands as the sensor sees them",
        default=False,
        update=show_passes,
    )
    transmittance_length: FloatProperty(
        name="Length (m)",
        description="Way through a gas, in metres, for which panels draw its transmittance; renders do not use it",
        default=1.0,
        min=1e-6,
        soft_max=10_000.0,
        precision=3,
    )
    band_exr_path: StringProperty(
        name="Path",
        description="Write each final render to files of this name, one for each of the formats below. '//' starts at "
        "the blend file, '####' is the frame number; empty writes nothing",
        default="",
        subtype="FILE_PATH",
        options={"ANIMATABLE", "PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    file_formats: EnumProperty(
        name="Formats",
        description="Formats of the files of each final render; several may be chosen",
        items=ENUM_ITEMS,
        options={"ENUM_FLAG"},
        default={"BAND_EXR"},
    )
    group_exr_path: StringProperty(
        name="Path",
        description="Write the light of each temperature group of a final render to a file of this name, from which it "
        "is recombined for other temperatures. '//' starts at the blend file, '####' is the frame number; empty keeps "
        "no groups apart",
        default="",
        subtype="FILE_PATH",
        options={"ANIMATABLE", "PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    checkpoint_path: StringProperty(
        name="Checkpoint",
        description="Save the finished passes of a running render to this file, from which the same render goes on "
        "after a crash or after Esc. '//' starts at the blend file, '####' is the frame number; empty saves nothing",
        default="",
        subtype="FILE_PATH",
        options={"ANIMATABLE", "PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    label_path: StringProperty(
        name="Path",
        description="Write a mask, boxes and temperatures of each instance that is seen to a file of this name, in "
        "COCO's format: of objects with a custom property 'category', or in a collection with one. '//' starts at the "
        "blend file, '####' is the frame number; empty writes nothing",
        default="",
        subtype="FILE_PATH",
        options={"ANIMATABLE", "PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    film_path: StringProperty(
        name="Keep Film",
        description="Keep the passes of a render in this file, also when it is complete: it can be extended by further "
        "passes, or merged with passes from other machines. '//' starts at the blend file, '####' is the frame number; "
        "empty keeps none",
        default="",
        subtype="FILE_PATH",
        options={"ANIMATABLE", "PATH_SUPPORTS_BLEND_RELATIVE"},
    )
    checkpoint_minutes: FloatProperty(
        name="Every (Minutes)",
        description="Time between two checkpoints, in minutes",
        default=10.0,
        min=0.0,
        soft_max=120.0,
        precision=1,
    )


def register():
    bpy.utils.register_class(InfraredSpot)
    bpy.utils.register_class(InfraredSettings)
    bpy.types.Scene.infrared = PointerProperty(type=InfraredSettings, name="Infrared Photons")


def unregister():
    del bpy.types.Scene.infrared
    bpy.utils.unregister_class(InfraredSettings)
    bpy.utils.unregister_class(InfraredSpot)
