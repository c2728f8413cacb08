"""Exports with every format and reads it back with tools that are not ours: OBJ with meshio, glTF with the Khronos validator
and three.js (readback.mjs), PC2 by its header; all must show the same positions to single precision, and the source's faces.

readback.py TENTER NODE_FOLDER, where NODE_FOLDER holds node_modules and readback.mjs.
"""

import json
import struct
import subprocess
import sys
import tempfile
from pathlib import Path

import meshio
import numpy as np

TENTER, NODE = sys.argv[1], Path(sys.argv[2])
ROOT = Path(__file__).resolve().parents[2]
SINGLE = 2.0**-23  # spacing of numbers in single precision, relative
MESHES = ROOT / "assets/meshes"
RELAXED = ["--set", "simulator.id=verlet"]
# Scene, its file where that is an OBJ, frames a second, options. 24 a second falls between steps of 0.02 s.
CASES = [
    ("sheet", None, 25, []),
    ("flag", None, 24, []),
    (str(MESHES / "skirt_72x24.obj"), MESHES / "skirt_72x24.obj", 24, ["--set", "pins=[Top(0.03)]"]),
    (str(MESHES / "cape_mixed.obj"), MESHES / "cape_mixed.obj", 25, RELAXED),
    (str(MESHES / "cylinder_20x5.gltf"), None, 30, RELAXED),
    (str(ROOT / "tests/export/patches.obj"), ROOT / "tests/export/patches.obj", 25, RELAXED),
]
SECONDS = 0.4


def export(scene, fps, options, out):
    command = [TENTER, "export", scene, "--seconds", SECONDS, "--fps", fps, "--out", out, "--json", *options]
    done = subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True)
    return json.loads(done.stdout)


def point_cache(path):
    """Frames x points x 3 of a PC2 file."""
    data = path.read_bytes()
    magic, version, points, start, rate, samples = struct.unpack("<12siiffi", data[:32])
    assert (magic, version, start, rate) == (b"POINTCACHE2\0", 1, 0.0, 1.0), data[:32]
    assert len(data) == 32 + samples * points * 12, path
    return np.frombuffer(data, "<f4", offset=32).reshape(samples, points, 3)


def faces(mesh):
    return [(block.type, block.data.tolist()) for block in mesh.cells]


def read_obj(path):
    """meshio takes no line that it does not know, and only as many texture coordinates as vertices: positions and faces it is."""
    kept = [line.split() for line in path.read_text().splitlines() if line.startswith(("v ", "f ", "l "))]
    plain = FOLDER / "plain.obj"
    plain.write_text("".join(" ".join(word.split("/")[0] for word in words) + "\n" for words in kept))
    return meshio.read(plain)


with tempfile.TemporaryDirectory() as folder:
    FOLDER = Path(folder)
    read = {}
    for number, (scene, source, fps, options) in enumerate(CASES):
        stem = FOLDER / f"case{number}"
        for extension in ["obj", "pc2", "glb", "gltf"]:
            told = export(scene, fps, options, stem.with_suffix("." + extension))
            assert told["frames"] == int(SECONDS * fps + 1e-9) + 1 and told["health"]["state"] != "diverged", told
        objs = [read_obj(path) for path in sorted(stem.glob("case*_[0-9][0-9][0-9][0-9].obj"))]
        cache = point_cache(stem.with_suffix(".pc2"))
        points = np.array([mesh.points for mesh in objs])
        assert points.shape == cache.shape, (points.shape, cache.shape)
        assert (points.astype("<f4") == cache).all(), "PC2 and OBJ differ"
        assert (points[0] != points[-1]).any(), "nothing moves"
        assert all(faces(mesh) == faces(objs[0]) for mesh in objs)
        if source:
            original = read_obj(source)
            assert (original.points == points[0]).all(), "frame 0 is not the source"
            assert faces(original) == faces(objs[0]), f"{scene}: the source's faces are not there"
        read[str(stem.with_suffix(".glb"))] = (scene, points)
    result = FOLDER / "read.json"
    files = [str(path) for path in sorted(FOLDER.glob("*.gl*"))]
    subprocess.run(["node", str(NODE / "readback.mjs"), str(result), *files], check=True)
    shown = json.loads(result.read_text())
    for file in files:
        assert shown[file]["errors"] == 0 and shown[file]["warnings"] == 0, shown[file]["told"]
    for file, (scene, points) in read.items():
        frames, between = np.array(shown[file]["frames"]), np.array(shown[file]["between"])
        # Vertices of a glTF file are corners of faces: each stands for the vertex of the OBJ file at its place.
        distance = np.linalg.norm(frames[0][:, None] - points[0][None], axis=2)
        vertex = distance.argmin(axis=1)
        # Base and difference are rounded, each by half a spacing.
        allowed = SINGLE * np.abs(points).max() * 2
        worst = np.abs(frames - points[:, vertex]).max()
        assert worst <= allowed, (scene, worst, allowed)
        halfway = (points[1:, vertex] + points[:-1, vertex]) / 2
        # Key times are rounded too: halfway is off by their spacing over the time between two.
        times = np.array(shown[file]["times"])
        slip = SINGLE * times.max() / np.diff(times).min() * np.abs(np.diff(points, axis=0)).max()
        worst = np.abs(between - halfway).max()
        assert worst <= allowed + slip, (scene, worst, allowed + slip)
        print(f"{Path(scene).name}: {len(points)} frames, {points.shape[1]} vertices, {frames.shape[1]} in glTF, "
              f"materials {shown[file]['materials']}, {shown[file]['uvs']} texture coordinates")
