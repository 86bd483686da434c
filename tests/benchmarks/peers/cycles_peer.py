# SPDX-License-Identifier: GPL-3.0-or-later
"""Cycles on the processor, in the bpy package: no limit that matters, no clamping, no filtering, no denoising."""

import os
import tempfile

import bpy
import numpy as np

_BOUNCES = 1024


def load(variant, problem, emission, reflectance, world, threads, clock):
    return _Cycles(variant, problem, emission, reflectance, world, threads, clock)


class _Cycles:
    def __init__(self, variant, problem, emission, reflectance, world, threads, clock):
        self.clock = clock
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene
        self.width, self.height = int(problem.width), int(problem.height)
        self._set_up(threads)
        self._place_camera(problem)
        self._surround(world)
        for part, vertices, triangles in problem.meshes():
            material = _material(reflectance[part], emission[part], problem.mirror[part])
            mesh = bpy.data.meshes.new(f"part{part}")
            mesh.from_pydata(vertices.tolist(), [], triangles.tolist())
            mesh.materials.append(material)
            self.scene.collection.objects.link(bpy.data.objects.new(f"part{part}", mesh))
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
        cycles.caustics_reflective = True

    def _place_camera(self, problem):
        from mathutils import Matrix

        data = bpy.data.cameras.new("camera")
        data.sensor_fit = "HORIZONTAL"
        data.sensor_width = 36.0
        data.lens = 18.0 / float(problem.tangent)
        data.clip_start = 1e-3
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
