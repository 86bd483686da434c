# SPDX-License-Identifier: GPL-3.0-or-later
"""Cycles on the processor, in the bpy package: no limit that matters, no clamping, no filtering, no denoising.

Gas comes as a closed mesh or a volume with the node Volume Coefficients. Cells of a volume are interpolated linearly,
and crossed in steps, which biases Cycles a little. Its mode without bias needs 1.4 times as long for an error in fog,
1.5 times in a plume, and 4 s before each render of the latter.
"""

import os
import tempfile

import bpy
import numpy as np

_BOUNCES = 1024


def load(variant, problem, threads, clock):
    return _Cycles(variant, problem, threads, clock)


class _Cycles:
    def __init__(self, variant, problem, threads, clock):
        self.clock = clock
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene
        self.width, self.height = int(problem.width), int(problem.height)
        self._set_up(threads)
        self._place_camera(problem)
        self._surround(problem.world)
        for part, vertices, triangles in problem.meshes():
            material = _material(problem.reflectance[part], problem.emission[part], problem.mirror[part])
            self._add(f"part{part}", _mesh(vertices, triangles), material)
        if problem.gas is not None:
            self._fill(problem.gas)
        self.overhead = 0.0
        self.render(1, 0)  # loads
        self.overhead = min(self.render(1, seed)[1] for seed in range(2))

    def _set_up(self, threads):
        scene, cycles = self.scene, self.scene.cycles
        render = scene.render
        render.engine = "CYCLES"
        render.resolution_x, render.resolution_y, render.resolution_percentage = self.width, self.height, 100
        render.threads_mode, render.threads = "FIXED", threads
        render.use_persistent_data = True
        render.image_settings.file_format = "OPEN_EXR"
        render.image_settings.color_depth = "32"
        render.image_settings.color_mode = "RGB"
        render.dither_intensity = 0.0
        scene.view_settings.view_transform = "Raw"
        cycles.device = "CPU"
        cycles.pixel_filter_type = "BOX"
        cycles.use_adaptive_sampling = cycles.use_denoising = False
        cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = _BOUNCES
        cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
        cycles.light_sampling_threshold = 0.0
        cycles.blur_glossy = 0.0
        cycles.volume_bounces = _BOUNCES
        cycles.volume_biased = True
        cycles.caustics_reflective = True

    def _place_camera(self, problem):
        from mathutils import Matrix

        data = bpy.data.cameras.new("camera")
        data.sensor_fit = "HORIZONTAL"
        data.sensor_width = 36.0
        data.lens = 18.0 / float(problem.tangent)
        data.clip_start = 1e-6
        data.clip_end = 1e4
        camera = bpy.data.objects.new("camera", data)
        camera.matrix_world = Matrix(problem.matrix.tolist())
        self.scene.collection.objects.link(camera)
        self.scene.camera = camera

    def _surround(self, radiance):
        world = bpy.data.worlds.new("world")
        self.scene.world = world
        world.use_nodes = True
        background = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
        background.inputs["Color"].default_value = (*map(float, radiance), 1.0)

    def _add(self, name, data, material):
        data.materials.append(material)
        self.scene.collection.objects.link(bpy.data.objects.new(name, data))

    def _fill(self, gas):
        data = _mesh(gas.vertices, gas.triangles) if gas.density is None else self._volume(gas)
        self._add("gas", data, _gas_material(gas))

    def _volume(self, gas):
        """Volume of grids "density" and, in units of the density's mean emission, "emission"."""
        self.files = tempfile.TemporaryDirectory()  # as long as the scene
        path = os.path.join(self.files.name, "gas.vdb")
        _write_grids(path, gas)
        data = bpy.data.volumes.new("gas")
        data.filepath = path
        data.render.precision = "FULL"
        return data

    def render(self, samples, seed):
        """Mean image (height, width, 3) of so many samples, row 0 the bottom, and the seconds it took."""
        self.scene.cycles.samples = samples
        self.scene.cycles.seed = seed % 2**31
        with tempfile.TemporaryDirectory() as folder:
            self.scene.render.filepath = os.path.join(folder, "image.exr")
            started = self.clock()
            bpy.ops.render.render(write_still=True)
            spent = self.clock() - started
            image = bpy.data.images.load(self.scene.render.filepath)
            image.colorspace_settings.name = "Non-Color"
            pixels = np.empty(self.width * self.height * image.channels, np.float32)
            image.pixels.foreach_get(pixels)
            pixels = pixels.reshape(self.height, self.width, image.channels)[..., :3].astype(np.float64)
            bpy.data.images.remove(image)
        return pixels, max(1e-3, spent - self.overhead)

    def close(self):
        pass


def _mesh(vertices, triangles):
    mesh = bpy.data.meshes.new("mesh")
    mesh.from_pydata(vertices.tolist(), [], triangles.tolist())
    return mesh


def _write_grids(path, gas):
    """An OpenVDB file of the density, and of what a cell emits where these differ, over the absorption."""
    from addon.reading.volumes import openvdb

    module = openvdb()
    # OpenVDB's integers are middles of cells
    matrix = gas.matrix @ np.block([[np.eye(3), np.full((3, 1), 0.5)], [np.zeros((1, 3)), 1.0]])
    values = {"density": (module.FloatGrid(), gas.density)}
    if gas.source.ndim > 1:
        values["emission"] = module.Vec3SGrid(), np.moveaxis(gas.source * gas.density, 0, -1)
    for name, (grid, cells) in values.items():
        grid.copyFromArray(np.ascontiguousarray(cells, np.float32))
        grid.name, grid.transform = name, module.createLinearTransform(matrix.T.tolist())
    module.write(path, grids=[grid for grid, _ in values.values()])


def _gas_material(gas):
    material = bpy.data.materials.new("gas")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    volume = tree.nodes.new("ShaderNodeVolumeCoefficients")
    volume.phase = "HENYEY_GREENSTEIN"
    volume.inputs["Anisotropy"].default_value = float(gas.anisotropy)
    by_cell = gas.source.ndim > 1
    for quantity, factor, values in (
        ("Absorption", "density", gas.absorption),
        ("Scatter", "density", gas.scattering),
        ("Emission", "emission" if by_cell else "density", gas.absorption * (1.0 if by_cell else gas.source)),
    ):
        coefficients = volume.inputs[f"{quantity} Coefficients"]
        coefficients.default_value = tuple(map(float, values))
        if gas.density is not None:
            _multiply(tree, coefficients, factor)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(volume.outputs[0], output.inputs["Volume"])
    return material


def _multiply(tree, socket, attribute):
    """Multiply what a vector's socket is set to by a grid of the volume."""
    grid = tree.nodes.new("ShaderNodeAttribute")
    grid.attribute_name = attribute
    product = tree.nodes.new("ShaderNodeVectorMath")
    product.operation = "MULTIPLY"
    product.inputs[1].default_value = socket.default_value
    tree.links.new(grid.outputs["Vector"], product.inputs[0])
    tree.links.new(product.outputs[0], socket)


def _material(reflectance, emission, mirror):
    """Diffuse or mirror, plus emission."""
    material = bpy.data.materials.new("part")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    surface = tree.nodes.new("ShaderNodeBsdfAnisotropic" if mirror else "ShaderNodeBsdfDiffuse")
    surface.inputs["Roughness"].default_value = 0.0
    surface.inputs["Color"].default_value = (*map(float, reflectance), 1.0)
    light = tree.nodes.new("ShaderNodeEmission")
    light.inputs["Color"].default_value = (*map(float, emission), 1.0)
    both = tree.nodes.new("ShaderNodeAddShader")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(surface.outputs[0], both.inputs[0])
    tree.links.new(light.outputs[0], both.inputs[1])
    tree.links.new(both.outputs[0], output.inputs["Surface"])
    return material
