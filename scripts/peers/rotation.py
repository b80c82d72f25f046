"""Rotation matrices and the angles that name them [rad]."""
import math

import numpy as np


def about(axis, angle):
    """About 'x', 'y' or 'z'."""
    c, s = math.cos(angle), math.sin(angle)
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    R = np.eye(3)
    R[j, j] = R[k, k] = c
    R[j, k], R[k, j] = -s, s
    return R


def from_body_xyz(angles):
    """Rx Ry Rz: Genu's poses and floating joints, OpenSim's orientations."""
    return about("x", angles[0]) @ about("y", angles[1]) @ about("z", angles[2])


def from_fixed_xyz(rpy):
    """Rz Ry Rx: URDF."""
    return about("z", rpy[2]) @ about("y", rpy[1]) @ about("x", rpy[0])


def to_body_xyz(R):
    return np.array([math.atan2(-R[1, 2], R[2, 2]), math.asin(max(-1.0, min(1.0, R[0, 2]))), math.atan2(-R[0, 1], R[0, 0])])


def with_z_along(axis):
    """A rotation whose z is `axis`."""
    z = np.asarray(axis, float) / np.linalg.norm(axis)
    helper = np.eye(3)[int(np.argmin(np.abs(z)))]
    x = np.cross(helper, z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


class Pose:
    """p_A = R p_B + p."""

    def __init__(self, R=None, p=None):
        self.R = np.eye(3) if R is None else R
        self.p = np.zeros(3) if p is None else np.asarray(p, float)

    def __mul__(self, other):
        return Pose(self.R @ other.R, self.R @ other.p + self.p)

    def apply(self, point):
        return self.R @ np.asarray(point, float) + self.p
