#!/usr/bin/env python3
"""Writes cylinder_20x5.obj and cylinder_20x5.gltf: 20 columns around the y axis, 6 rings, every edge 1 m long."""
import base64, json, math, struct

COLUMNS, ROWS = 20, 5
RADIUS = 0.5 / math.sin(math.pi / COLUMNS)

positions = []
for ring in range(ROWS + 1):
    for column in range(COLUMNS):
        angle = 2 * math.pi * column / COLUMNS
        positions.append((RADIUS * math.cos(angle), ROWS / 2 - ring, RADIUS * math.sin(angle)))
quads = []
for row in range(ROWS):
    for column in range(COLUMNS):
        here, beside = row * COLUMNS + column, row * COLUMNS + (column + 1) % COLUMNS
        quads.append((here, beside, beside + COLUMNS, here + COLUMNS))

with open("cylinder_20x5.obj", "w") as obj:
    obj.write("# Cylinder of 20 columns around the y axis and 5 rows of quads, every edge 1 m long.\n")
    obj.write("# Made by make_cylinder.py. CC0-1.0.\no cylinder\n")
    obj.writelines("v %.9f %.9f %.9f\n" % p for p in positions)
    obj.writelines("f %d %d %d %d\n" % tuple(i + 1 for i in quad) for quad in quads)

# The two triangles of a quad stand one after the other, so that a reader can bring the quads back.
indices = [i for a, b, c, d in quads for i in (a, b, c, a, c, d)]
points = b"".join(struct.pack("<3f", *p) for p in positions)
data = points + struct.pack("<%dH" % len(indices), *indices)
single = [struct.unpack("<3f", struct.pack("<3f", *p)) for p in positions]
document = {
    "asset": {"version": "2.0", "generator": "Tenter, assets/meshes/make_cylinder.py", "copyright": "CC0-1.0"},
    "scene": 0,
    "scenes": [{"nodes": [0]}],
    "nodes": [{"name": "cylinder", "mesh": 0}],
    "meshes": [{"name": "cylinder", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 4}]}],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": len(positions), "type": "VEC3",
         "min": [min(p[i] for p in single) for i in range(3)], "max": [max(p[i] for p in single) for i in range(3)]},
        {"bufferView": 1, "componentType": 5123, "count": len(indices), "type": "SCALAR"},
    ],
    "bufferViews": [
        {"buffer": 0, "byteOffset": 0, "byteLength": len(points), "target": 34962},
        {"buffer": 0, "byteOffset": len(points), "byteLength": len(data) - len(points), "target": 34963},
    ],
    "buffers": [{"byteLength": len(data),
                 "uri": "data:application/octet-stream;base64," + base64.b64encode(data).decode()}],
}
with open("cylinder_20x5.gltf", "w") as gltf:
    json.dump(document, gltf, indent=1)
    gltf.write("\n")
