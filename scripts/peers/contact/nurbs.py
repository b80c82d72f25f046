"""Points and normals of NURBS patches, for meshes of the surfaces that Genu uses as they are. Piegl & Tiller, The NURBS Book, 1997."""
import json
import pathlib

import numpy as np


def basis(knots, degree, number, t):
    """Basis functions and their derivatives at the parameters t: two arrays [len(t), number]."""
    t = np.clip(np.asarray(t, float), knots[degree], knots[number])
    span = np.clip(np.searchsorted(knots, t, side="right") - 1, degree, number - 1)
    N = np.zeros((len(t), len(knots) - 1))
    N[np.arange(len(t)), span] = 1.0
    lower = N
    for p in range(1, degree + 1):
        lower = N
        N = np.zeros((len(t), len(knots) - 1 - p))
        for i in range(N.shape[1]):
            left, right = knots[i + p] - knots[i], knots[i + p + 1] - knots[i + 1]
            if left > 0:
                N[:, i] += (t - knots[i]) / left * lower[:, i]
            if right > 0:
                N[:, i] += (knots[i + p + 1] - t) / right * lower[:, i + 1]
    D = np.zeros_like(N)
    for i in range(number):
        left, right = knots[i + degree] - knots[i], knots[i + degree + 1] - knots[i + 1]
        if left > 0:
            D[:, i] += degree / left * lower[:, i]
        if right > 0:
            D[:, i] -= degree / right * lower[:, i + 1]
    return N, D


class Patch:
    """One patch, in metres. Normals point out of the material, like Genu's."""

    def __init__(self, given, unit_m):
        self.degree = given["degree"]
        self.knots = [np.array(given["knots_u"], float), np.array(given["knots_v"], float)]
        self.points = unit_m * np.array(given["points"], float)
        self.weights = np.array(given["weights"], float) if given.get("weights") else np.ones(self.points.shape[:2])
        self.flip = bool(given.get("flip_normal"))
        self.domain = [(k[d], k[n]) for k, d, n in zip(self.knots, self.degree, self.points.shape)]

    def _evaluate(self, u, v, product):
        """product: the einsum of (values over u), (values over v) and the control points."""
        (U, dU), (V, dV) = (basis(k, d, n, t) for k, d, n, t in zip(self.knots, self.degree, self.points.shape, (u, v)))
        weighted = np.concatenate([self.points * self.weights[..., None], self.weights[..., None]], axis=2)
        S, Su, Sv = (np.einsum(product, a, b, weighted, optimize=True) for a, b in ((U, V), (dU, V), (U, dV)))
        point = S[..., :3] / S[..., 3:]
        tangents = [(D[..., :3] - point * D[..., 3:]) / S[..., 3:] for D in (Su, Sv)]
        return point, tangents[0], tangents[1]

    def _normal(self, Su, Sv):
        n = np.cross(Su, Sv)
        return (-1 if self.flip else 1) * n / np.linalg.norm(n, axis=-1, keepdims=True)

    def grid(self, nu, nv):
        """Points and normals over the whole patch, [nu + 1, nv + 1, 3]."""
        u, v = (np.linspace(*d, n + 1) for d, n in zip(self.domain, (nu, nv)))
        point, Su, Sv = self._evaluate(u, v, "ai,bj,ijk->abk")
        return point, self._normal(Su, Sv)

    def sizes(self):
        """Largest lengths along u and along v [m]."""
        p = self.grid(60, 60)[0]
        return [np.linalg.norm(np.diff(p, axis=a), axis=2).sum(axis=a).max() for a in (0, 1)]

    def above(self, x, z):
        """Points and normals over the grid of x and z: the patch as a height field [len(x), len(z), 3]."""
        X, Z = (g.ravel() for g in np.meshgrid(x, z, indexing="ij"))
        coarse = self.grid(60, 60)[0]
        nearest = [np.argmin((coarse[..., 0] - a) ** 2 + (coarse[..., 2] - b) ** 2) for a, b in zip(X, Z)]
        i, j = np.unravel_index(nearest, coarse.shape[:2])
        u, v = (d[0] + (d[1] - d[0]) * k / 60 for d, k in zip(self.domain, (i, j)))
        for _ in range(30):
            point, Su, Sv = self._evaluate(u, v, "ai,aj,ijk->ak")
            rx, rz = X - point[:, 0], Z - point[:, 2]
            if max(abs(rx).max(), abs(rz).max()) < 1e-10:
                break
            det = Su[:, 0] * Sv[:, 2] - Su[:, 2] * Sv[:, 0]
            u = np.clip(u + (rx * Sv[:, 2] - rz * Sv[:, 0]) / det, *self.domain[0])
            v = np.clip(v + (rz * Su[:, 0] - rx * Su[:, 2]) / det, *self.domain[1])
        else:
            raise ValueError("the rectangle is not wholly on the patch")
        shape = (len(x), len(z), 3)
        return point.reshape(shape), self._normal(Su, Sv).reshape(shape)


def read(file):
    given = json.loads(pathlib.Path(file).read_text())
    if given["format"] != "genu-nurbs":
        raise ValueError(f"{file} is no file of NURBS patches")
    return [Patch(p, {"mm": 1e-3, "m": 1.0}[given["length_unit"]]) for p in given["patches"]]
