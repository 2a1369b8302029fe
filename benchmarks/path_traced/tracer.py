"""Traces the frames of one job in Blender's Cycles. Run by the interpreter that has `bpy`: `tracer.py JOB.json`.

The job and `meshes.npz` beside it say everything. `still.npy` is the linear light of the scene without the robot,
(rows, columns, 3), and `FRAME-WINDOW.npy` that of a frame's windows, in half precision. What is there already is left
alone. Lengths in the job are mm; a unit of Blender is 10 mm.
"""

import json
import math
import sys
from pathlib import Path

import bpy
import numpy as np

UNIT = 0.1


def main(path: Path) -> None:
    job = json.loads(path.read_text())
    folder = path.parent
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    set_up_renderer(scene, job)
    add_camera(scene, job["camera"], job["size"])
    add_tank(job, folder)
    add_lights(scene, job)
    parts = add_robot(job, np.load(folder / "meshes.npz"))
    hand = add_hand(job["hand"]) if job["hand"] else None
    still = folder / "still.npy"
    if not still.exists():
        hide(parts["all"], hidden=True)
        scene.cycles.samples = job["still_samples"]
        np.save(still, rendered(scene, folder, None))
        hide(parts["all"], hidden=False)
    scene.cycles.samples = job["samples"]
    for number, frame in enumerate(job["frames"]):
        missing = [k for k in range(len(frame["windows"])) if not (folder / f"{number:05d}-{k}.npy").exists()]
        if missing:
            place(scene, parts, frame, number)
        if missing and hand is not None:
            hand.location = [UNIT * value for value in frame["hand"]]
        for k in missing:
            scene.cycles.seed = 7919 * job["seed"] + 2 * number + k
            part = folder / "part.npy"
            np.save(part, rendered(scene, folder, frame["windows"][k]))
            part.rename(folder / f"{number:05d}-{k}.npy")
        print(f"frame {number + 1} of {len(job['frames'])}", flush=True)


def set_up_renderer(scene, job) -> None:
    scene.render.engine = "CYCLES"
    scene.render.resolution_x, scene.render.resolution_y = job["size"]
    scene.render.resolution_percentage = 100
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.render.use_persistent_data = True
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "16"
    scene.render.use_motion_blur, scene.render.motion_blur_shutter = True, job["shutter"]
    scene.render.motion_blur_position = "CENTER"
    scene.view_settings.view_transform = "Raw"
    cycles = scene.cycles
    cycles.device, cycles.use_adaptive_sampling = "CPU", False
    cycles.use_denoising, cycles.denoiser = True, "OPENIMAGEDENOISE"
    cycles.denoising_input_passes = "RGB"  # glass hides albedo and normals from the denoiser
    cycles.max_bounces, cycles.diffuse_bounces, cycles.glossy_bounces = 14, (2 if job["caustics"] else 0), 4
    cycles.transmission_bounces, cycles.transparent_max_bounces = 14, 24
    cycles.caustics_reflective = False
    cycles.caustics_refractive = job["caustics"]
    cycles.blur_glossy = 0.5
    cycles.sample_clamp_indirect = 3.0


def rendered(scene, folder: Path, window) -> np.ndarray:
    """Linear light of the picture, or of a window (left, top, right, bottom) of it."""
    width, height = scene.render.resolution_x, scene.render.resolution_y
    scene.render.use_border = scene.render.use_crop_to_border = window is not None
    if window is not None:
        left, top, right, bottom = window
        inside = 0.25  # Blender cuts fractions of pixels off
        scene.render.border_min_x, scene.render.border_max_x = (left + inside) / width, (right + inside) / width
        scene.render.border_min_y = (height - bottom + inside) / height
        scene.render.border_max_y = (height - top + inside) / height
    target = folder / "render.exr"
    scene.render.filepath = str(target)
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(str(target), check_existing=False)
    image.colorspace_settings.name = "Non-Color"
    columns, rows = image.size
    left, top, right, bottom = window or (0, 0, width, height)
    if (columns, rows) != (right - left, bottom - top):
        raise SystemExit(f"a window of {columns} x {rows} pixels was traced instead of {right - left} x {bottom - top}")
    values = np.empty(columns * rows * 4, dtype=np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    target.unlink()
    return values.reshape(rows, columns, 4)[::-1, :, :3].astype(np.float16)


def add_camera(scene, camera, size) -> None:
    data = bpy.data.cameras.new("camera")
    data.sensor_fit, data.sensor_width = "HORIZONTAL", 36.0
    data.lens = 36.0 * camera["focal_pixels"] / size[0]
    data.clip_start, data.clip_end = 0.01, 1000.0
    data.dof.use_dof = camera["aperture"] > 0
    data.dof.focus_distance = UNIT * camera["focus"]
    data.dof.aperture_fstop = 1e-3 * data.lens / (2.0 * UNIT * max(camera["aperture"], 1e-6))
    seen = bpy.data.objects.new("camera", data)
    seen.location = (0.0, 0.0, UNIT * camera["eye"])
    seen.rotation_euler = (*camera["tilt"], camera["roll"])
    scene.collection.objects.link(seen)
    scene.camera = seen


def add_mesh(name, vertices, faces, materials, *, smooth=35.0, index=None):
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata((UNIT * np.asarray(vertices)).tolist(), [], np.asarray(faces).tolist())
    for material in materials:
        mesh.materials.append(material)
    if index is not None:
        mesh.polygons.foreach_set("material_index", index)
    if smooth:
        mesh.shade_smooth()
        mesh.set_sharp_from_angle(angle=math.radians(smooth))
    mesh.update()
    seen = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(seen)
    return seen


def new_material(name):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    nodes = material.node_tree.nodes
    nodes.clear()
    return material, nodes, material.node_tree.links


def glass(name, index, colour=(1.0, 1.0, 1.0)):
    """A dielectric interface."""
    material, nodes, links = new_material(name)
    out, bsdf = nodes.new("ShaderNodeOutputMaterial"), nodes.new("ShaderNodeBsdfGlass")
    bsdf.inputs["IOR"].default_value = index
    bsdf.inputs["Roughness"].default_value = 0.0
    bsdf.inputs["Color"].default_value = (*colour, 1.0)
    links.new(bsdf.outputs[0], out.inputs[0])
    return material


def clear_after_diffuse(material) -> None:
    """No interface for paths that have left a diffuse surface: Cycles does not scale radiance by the index squared."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    path, mix, clear = (nodes.new(f"ShaderNode{kind}") for kind in ("LightPath", "MixShader", "BsdfTransparent"))
    bsdf = next(node for node in nodes if node.type == "BSDF_GLASS")
    out = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
    links.new(path.outputs["Diffuse Depth"], mix.inputs[0])
    links.new(bsdf.outputs[0], mix.inputs[1])
    links.new(clear.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], out.inputs[0])


def let_light_through(seen) -> None:
    """Light goes straight from lamps to diffuse surfaces, as if the object were not there."""
    seen.visible_shadow = seen.visible_diffuse = False


def opaque(name, colour, roughness=0.6, metallic=0.0):
    material, nodes, links = new_material(name)
    out, bsdf = nodes.new("ShaderNodeOutputMaterial"), nodes.new("ShaderNodeBsdfPrincipled")
    bsdf.inputs["Base Color"].default_value = (*colour, 1.0)
    bsdf.inputs["Roughness"].default_value = roughness
    bsdf.inputs["Metallic"].default_value = metallic
    links.new(bsdf.outputs[0], out.inputs[0])
    return material


def printed(name, picture):
    material, nodes, links = new_material(name)
    out, bsdf = nodes.new("ShaderNodeOutputMaterial"), nodes.new("ShaderNodeBsdfDiffuse")
    texture = nodes.new("ShaderNodeTexImage")
    texture.image = bpy.data.images.load(str(picture))
    links.new(texture.outputs["Color"], bsdf.inputs["Color"])
    links.new(bsdf.outputs[0], out.inputs[0])
    return material


def mottled(name, grey):
    material, nodes, links = new_material(name)
    out, bsdf = nodes.new("ShaderNodeOutputMaterial"), nodes.new("ShaderNodeBsdfDiffuse")
    noise, ramp = nodes.new("ShaderNodeTexNoise"), nodes.new("ShaderNodeMapRange")
    coordinates = nodes.new("ShaderNodeTexCoord")
    noise.inputs["Scale"].default_value, noise.inputs["Detail"].default_value = 0.5, 6.0
    ramp.inputs["To Min"].default_value, ramp.inputs["To Max"].default_value = 0.92 * grey, 1.08 * grey
    links.new(coordinates.outputs["Object"], noise.inputs["Vector"])
    links.new(noise.outputs[0], ramp.inputs["Value"])
    links.new(ramp.outputs[0], bsdf.inputs["Color"])
    links.new(bsdf.outputs[0], out.inputs[0])
    return material


def rectangle(name, centre, size, material, z):
    (x, y), (w, h) = centre, size
    corners = [(x + a * w / 2, y + b * h / 2, z) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    seen = add_mesh(name, corners, [(0, 1, 2, 3)], [material], smooth=None)
    layer = seen.data.uv_layers.new(name="uv")
    for corner, uv in enumerate(((0, 0), (1, 0), (1, 1), (0, 1))):
        layer.data[corner].uv = uv
    return seen


def add_tank(job, folder: Path) -> None:
    oil, tube = job["oil"], job["tube"]
    rectangle("floor", (0, 0), (700, 500), mottled("floor", 0.42), 0.0)
    for number, paper in enumerate(job["papers"]):
        material = printed(f"paper {number}", folder / paper["picture"])
        rectangle(f"paper {number}", paper["centre"], paper["size"], material, paper["height"])
    surface = glass("oil", oil["index"], (0.985, 0.99, 0.965))
    seen = rectangle("oil", (0, 0), (2000, 2000), surface, oil["height"])
    if job["caustics"]:
        clear_after_diffuse(surface)
        seen.visible_shadow = False
    else:
        let_light_through(seen)
    material = glass("tube", tube["index"] / oil["index"])
    x = np.array([-0.5, 0.5]) * tube["length"]
    for name, radius, outward in (("outside", tube["outer"], True), ("inside", tube["inner"], False)):
        angle = np.linspace(0.0, 2.0 * np.pi, 256, endpoint=False)
        ring = np.stack([np.zeros_like(angle), radius * np.cos(angle), tube["axis"] + radius * np.sin(angle)], axis=-1)
        vertices = np.concatenate([ring + np.array([end, 0.0, 0.0]) for end in x])
        a = np.arange(256)
        quads = np.stack([a, a + 256, np.roll(a, -1) + 256, np.roll(a, -1)], axis=-1)
        seen = add_mesh(f"tube {name}", vertices, quads[:, ::-1] if outward else quads, [material], smooth=60.0)
        if not job["caustics"]:
            let_light_through(seen)


def add_lights(scene, job) -> None:
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs[0].default_value = (*job["ambient"], 1.0)
    background.inputs[1].default_value = 1.0
    scene.world = world
    for number, lamp in enumerate(job["lamps"]):
        data = bpy.data.lights.new(f"lamp {number}", "AREA")
        data.shape, data.size, data.size_y = "RECTANGLE", UNIT * lamp["size"][0], UNIT * lamp["size"][1]
        data.energy = lamp["radiance"] * math.pi * data.size * data.size_y
        data.color = lamp["colour"]
        seen = bpy.data.objects.new(f"lamp {number}", data)
        seen.location = [UNIT * value for value in lamp["centre"]]
        scene.collection.objects.link(seen)


def add_robot(job, meshes):
    root, body, rotor = (bpy.data.objects.new(name, None) for name in ("root", "body", "rotor"))
    found = {"root": root, "body": body, "rotor": rotor, "all": []}
    for empty in (root, body, rotor):
        bpy.context.scene.collection.objects.link(empty)
        empty.rotation_mode = "XYZ"
    body.parent = rotor.parent = root
    for number, mesh in enumerate(job["meshes"]):
        vertices, faces, colours = (meshes[f"{name}{number}"] for name in ("vertices", "faces", "colours"))
        material = mesh["material"]
        if material["kind"] == "glass":
            outside = job["oil"]["index"] if material["outside"] == "oil" else 1.0
            index = material["index"] / outside
            materials = [glass(f"cover {number}", index)]
            which = np.zeros(len(faces), dtype=np.int32)
        else:
            palette, which = np.unique(np.round(colours, 4), axis=0, return_inverse=True)
            materials = [
                opaque(f"paint {number} {k}", tuple(colour), material["roughness"], material["metallic"])
                for k, colour in enumerate(palette.tolist())
            ]
        seen = add_mesh(f"part {number}", vertices, faces, materials, index=which.reshape(-1).astype(np.int32))
        seen.parent = found[mesh["part"]]
        if material["kind"] == "glass" and not job["caustics"]:
            let_light_through(seen)
        found["all"].append(seen)
    return found


def add_hand(hand):
    """A hand of rounded bones, skin-coloured, about its wrist."""
    skin = opaque("skin", hand["colour"], 0.55)
    wrist = bpy.data.objects.new("wrist", None)
    bpy.context.scene.collection.objects.link(wrist)
    for place, scale, turn in hand["bones"]:
        bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16, radius=1.0)
        bone = bpy.context.object
        bone.scale, bone.location = [UNIT * value for value in scale], [UNIT * value for value in place]
        bone.rotation_euler = (0.0, 0.0, turn)
        bone.data.shade_smooth()
        bone.data.materials.append(skin)
        bone.parent = wrist
    return wrist


def hide(objects, *, hidden: bool) -> None:
    for one in objects:
        one.hide_render = hidden


def place(scene, parts, frame, number: int) -> None:
    """Keys at the beginning, the middle and the end of the exposure, linear between them."""
    for part in (parts["root"], parts["body"], parts["rotor"]):
        part.animation_data_clear()
    for offset, pose in frame["keys"]:
        time = number + 1 + offset
        root, body, rotor = parts["root"], parts["body"], parts["rotor"]
        root.location = [UNIT * value for value in pose["position"]]
        root.rotation_euler = (0.0, 0.0, pose["heading"])
        body.rotation_euler = (pose["body_angle"], 0.0, 0.0)
        rotor.rotation_euler = (pose["tail_phase"], 0.0, 0.0)
        root.keyframe_insert("location", frame=time)
        for part in (root, body, rotor):
            part.keyframe_insert("rotation_euler", frame=time)
    for part in (parts["root"], parts["body"], parts["rotor"]):
        for curve in part.animation_data.action.fcurves:
            for key in curve.keyframe_points:
                key.interpolation = "LINEAR"
    scene.frame_set(number + 1)


if __name__ == "__main__":
    main(Path(sys.argv[-1]).resolve())
