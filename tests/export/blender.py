"""Reads exports back with Blender: the GLB's shape keys and their action, and the PC2 in a Mesh Cache modifier on the first OBJ.

blender.py TENTER, with the Python package bpy (tried with bpy 4.5.15, on Python 3.11). By hand: it is too large for CI.
"""

import subprocess
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

FPS, SECONDS = 25, 1


def shown(thing, frame):
    """Vertices and polygons of an object in a frame, with its modifiers and shape keys."""
    bpy.context.scene.frame_set(frame)
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = evaluated.to_mesh()
    vertices = np.empty(len(mesh.vertices) * 3)
    mesh.vertices.foreach_get("co", vertices)
    sizes = [len(polygon.vertices) for polygon in mesh.polygons]
    evaluated.to_mesh_clear()
    return vertices.reshape(-1, 3), sizes


def the_mesh():
    [thing] = [thing for thing in bpy.data.objects if thing.type == "MESH"]
    return thing


def positions(path):
    return np.array([[float(x) for x in line.split()[1:]] for line in path.open() if line.startswith("v ")])


with tempfile.TemporaryDirectory() as folder:
    stem = Path(folder) / "sheet"
    for extension in ["obj", "pc2", "glb"]:
        command = [sys.argv[1], "export", "sheet", "--seconds", str(SECONDS), "--fps", str(FPS)]
        subprocess.run([*command, "--out", str(stem.with_suffix("." + extension))], check=True)
    frames = [positions(path) for path in sorted(stem.glob("*.obj"))]
    # A spacing of single precision for each of a base and a difference.
    allowed = 2 * 2.0**-23 * max(np.abs(frame).max() for frame in frames)

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.context.scene.render.fps = FPS
    bpy.ops.import_scene.gltf(filepath=str(stem.with_suffix(".glb")))
    cloth = the_mesh()
    first, last = (int(frame) for frame in cloth.data.shape_keys.animation_data.action.frame_range)
    assert last - first == len(frames) - 1, (first, last)
    z_up = [np.stack([frame[:, 0], -frame[:, 2], frame[:, 1]], 1) for frame in frames]
    vertex = [int(((z_up[0] - v) ** 2).sum(1).argmin()) for v in shown(cloth, first)[0]]
    worst = max(np.abs(shown(cloth, first + n)[0] - frame[vertex]).max() for n, frame in enumerate(z_up))
    assert worst <= allowed, worst
    print(f"GLB: {len(frames)} frames, off by at most {worst:.1e} m")

    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.obj_import(filepath=str(stem / "sheet_0000.obj"), forward_axis="Y", up_axis="Z")
    cloth = the_mesh()
    cache = cloth.modifiers.new("cache", "MESH_CACHE")
    cache.cache_format, cache.filepath, cache.frame_start = "PC2", str(stem.with_suffix(".pc2")), 1
    cache.forward_axis, cache.up_axis = "POS_Y", "POS_Z"
    worst = max(np.abs(shown(cloth, 1 + n)[0] - frame).max() for n, frame in enumerate(frames))
    sizes = shown(cloth, 1)[1]
    assert worst <= allowed and sizes == [4] * 576 and len(cloth.data.uv_layers) == 1, (worst, sizes)
    print(f"OBJ with PC2: {len(frames)} frames, {len(sizes)} quads, off by at most {worst:.1e} m")
