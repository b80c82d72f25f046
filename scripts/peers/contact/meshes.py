"""Meshes that Drake and OpenSim read, from points and normals on structured grids [i, j, 3]."""
import itertools
import pathlib

import numpy as np


def _facing(points, normals, i, j):
    """Whether the corner order (i, j), (i + 1, j), (i, j + 1) turns about the outward normal."""
    p = points
    return np.dot(np.cross(p[i + 1, j] - p[i, j], p[i, j + 1] - p[i, j]), normals[i, j]) > 0


def sheet(points, normals):
    """Vertices and triangles of an open sheet, seen from outside counter-clockwise."""
    ni, nj = points.shape[:2]
    index = np.arange(ni * nj).reshape(ni, nj)
    a, b, c, d = (x.ravel() for x in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    triangles = np.concatenate([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    if not _facing(points, normals, ni // 2, nj // 2):
        triangles = triangles[:, ::-1]
    return points.reshape(-1, 3), triangles


def closed(points, normals, depth):
    """The sheet, a copy `depth` inside the material and walls between them: what OpenSim asks of a mesh."""
    ni, nj = points.shape[:2]
    top, faces = sheet(points, normals)
    bottom = (points - depth * normals).reshape(-1, 3)
    n = len(top)
    index = np.arange(n).reshape(ni, nj)
    rim = np.concatenate([index[:, 0], index[-1, 1:], index[-2::-1, -1], index[0, -2:0:-1]])
    after = np.roll(rim, -1)
    walls = np.concatenate([np.column_stack([rim, rim + n, after]), np.column_stack([after, rim + n, after + n])])
    # An edge of the rim must run the other way in the wall than in the sheet.
    edges = {(int(f[k]), int(f[(k + 1) % 3])) for f in faces for k in range(3)}
    if (int(walls[0, 2]), int(walls[0, 0])) in edges:
        walls = walls[:, ::-1]
    return np.concatenate([top, bottom]), np.concatenate([faces, faces[:, ::-1] + n, walls])


def layer(points, normals, depth, lip=0.15e-3):
    """Vertices and tetrahedra of a layer for a pressure field that is linear in the distance to its surface: Drake makes the pressure of a
    vertex its modulus times its distance to the nearest boundary over the largest such distance. So there are vertices at `depth` below
    the surface, as much again below them, and a border around whose sides are far enough from them. The surface ends where the points do: beyond
    them the border lies lower by `lip`, more than anything penetrates there, so that it is not touched; less than it, or the field near the
    end would be of the border's distance."""
    up = np.array([0.0, 1.0, 0.0])
    pad = lambda p: np.pad(p, ((2, 2), (2, 2), (0, 0)), mode="edge")
    levels = [pad(points - k * depth * normals) for k in range(3)]
    x_axis, z_axis = (np.mean(d, axis=(0, 1)) * [1, 0, 1] for d in (points[-1:] - points[:1], points[:, -1:] - points[:, :1]))
    x_axis, z_axis = x_axis / np.linalg.norm(x_axis), z_axis / np.linalg.norm(z_axis)
    # Of the grid's columns: how far out, along each axis [m]. A column beside the surface, and one that is the border.
    beside = 0.05e-3
    ways = []
    for n in points.shape[:2]:
        way = np.zeros(n + 4)
        way[:2], way[-2:] = (-2 * depth, -beside), (beside, 2 * depth)
        ways.append(way)
    out = ways[0][:, None, None] * x_axis + ways[1][None, :, None] * z_axis
    ring = np.ones(out.shape[:2], bool)
    ring[1:-1, 1:-1] = False
    near = np.any(out != 0, axis=2) & ~ring
    for k, (level, drop) in enumerate(zip(levels, (0.5, 1.0, 2.0))):
        level[near] += out[near] - (lip * pad(normals)[near] if k == 0 else 0)  # along the cells' edges
        level[ring] = pad(points)[ring] + out[ring] - drop * depth * up
    vertices = np.stack(levels)
    index = np.arange(vertices[..., 0].size).reshape(vertices.shape[:3])
    corner = lambda a, b, c: index[a : index.shape[0] - 1 + a, b : index.shape[1] - 1 + b, c : index.shape[2] - 1 + c].ravel()
    tetrahedra = []
    for order in itertools.permutations(range(3)):  # six to a cell, along its diagonal; neighbours fit
        path = [np.zeros(3, int)]
        for axis in order:
            path.append(path[-1] + np.eye(3, dtype=int)[axis])
        tetrahedra.append(np.column_stack([corner(*q) for q in path]))
    tetrahedra, vertices = np.concatenate(tetrahedra), vertices.reshape(-1, 3)
    a, b, c, d = (vertices[tetrahedra[:, k]] for k in range(4))
    volume = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)
    # Half of the orders turn the other way, all of their tetrahedra alike; one that differs is turned inside out.
    cells = len(volume) // 6
    for k in range(6):
        part = slice(k * cells, (k + 1) * cells)
        sign = np.sign(np.median(volume[part]))
        if np.any(sign * volume[part] <= 0):
            raise ValueError(f"{np.sum(sign * volume[part] <= 0)} tetrahedra of the layer are inside out: it is too deep for its surface's curvature")
        if sign < 0:
            tetrahedra[part] = tetrahedra[part][:, [0, 2, 1, 3]]
    return vertices, tetrahedra


def write_obj(file, vertices, triangles):
    lines = [f"v {v[0]:.12g} {v[1]:.12g} {v[2]:.12g}" for v in vertices] + [f"f {t[0] + 1} {t[1] + 1} {t[2] + 1}" for t in triangles]
    pathlib.Path(file).write_text("\n".join(lines) + "\n")


def write_vtk(file, vertices, tetrahedra):
    lines = ["# vtk DataFile Version 3.0", "layer", "ASCII", "DATASET UNSTRUCTURED_GRID", f"POINTS {len(vertices)} double"]
    lines += [f"{v[0]:.12g} {v[1]:.12g} {v[2]:.12g}" for v in vertices]
    lines += [f"CELLS {len(tetrahedra)} {5 * len(tetrahedra)}"] + [f"4 {t[0]} {t[1]} {t[2]} {t[3]}" for t in tetrahedra]
    lines += [f"CELL_TYPES {len(tetrahedra)}"] + ["10"] * len(tetrahedra)
    pathlib.Path(file).write_text("\n".join(lines) + "\n")
