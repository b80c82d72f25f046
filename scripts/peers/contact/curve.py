"""The curve that Genu lays through a table: cubic spline, not-a-knot ends, as src/model/TimeCurve.cpp."""
import csv

import numpy as np

from ..scene import quantity


class Curve:
    def __init__(self, t, y):
        self.t, self.y = np.asarray(t, float), np.asarray(y, float)
        n, h = len(self.t), np.diff(self.t)
        A, b = np.zeros((n, n)), np.zeros(n)
        for i in range(1, n - 1):
            A[i, i - 1 : i + 2] = h[i - 1], 2 * (h[i - 1] + h[i]), h[i]
            b[i] = 6 * ((self.y[i + 1] - self.y[i]) / h[i] - (self.y[i] - self.y[i - 1]) / h[i - 1])
        A[0, :3] = h[1], -(h[0] + h[1]), h[0]  # the third derivative does not jump at the second point
        A[-1, -3:] = h[-1], -(h[-2] + h[-1]), h[-2]
        self.m = np.linalg.solve(A, b)

    def __call__(self, t, derivative=0):
        t = np.asarray(t, float)
        i = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        h, a, b = self.t[i + 1] - self.t[i], self.t[i + 1] - t, t - self.t[i]
        m0, m1, y0, y1 = self.m[i], self.m[i + 1], self.y[i], self.y[i + 1]
        if derivative == 0:
            return (m0 * a**3 + m1 * b**3) / (6 * h) + (y0 / h - m0 * h / 6) * a + (y1 / h - m1 * h / 6) * b
        return (m1 * b**2 - m0 * a**2) / (2 * h) + (y1 - y0) / h - (m1 - m0) * h / 6


class Constant:
    def __init__(self, value):
        self.value = value

    def __call__(self, t, derivative=0):
        return np.full_like(np.asarray(t, float), 0.0 if derivative else self.value)


def read(given, folder, data, cycle_s):
    """A number with a unit, or a table's column, of a scene."""
    if not isinstance(given, dict):
        return Constant(quantity(given))
    file = given["table"]
    file = data / file[len("data:") :] if file.startswith("data:") else folder / file
    with open(file) as lines:
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    time = given["time"]
    t = np.array([float(r[time["column"]]) for r in rows])
    t = t / 100 * cycle_s if time["unit"] == "percent" else t * quantity(f"1 {time['unit']}")
    scale = quantity(given["scale"]) if "scale" in given else 1.0
    return Curve(t, [scale * quantity(f"{r[given['column']]} {given['unit']}") for r in rows])
