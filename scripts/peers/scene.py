"""Reads what a comparison needs of a Genu scene and its URDF: joints, wraps, ligaments, springs, muscles. SI units.

Not a check of scenes: `genu check` is that."""
import math
import pathlib
import re
import xml.etree.ElementTree as xml

import numpy as np
import yaml

from .rotation import Pose, from_body_xyz, from_fixed_xyz

_UNITS = {
    "": 1.0, "1": 1.0, "%": 0.01, "m": 1.0, "mm": 1e-3, "rad": 1.0, "deg": math.pi / 180, "s": 1.0, "ms": 1e-3, "N": 1.0, "kN": 1e3,
    "N/m": 1.0, "N/mm": 1e3, "N s/m": 1.0, "N m s/rad": 1.0, "1/s": 1.0, "m/s^2": 1.0, "MPa": 1e6, "percent": 0.01,
}


def quantity(text):
    """'30 mm' -> 0.03"""
    if isinstance(text, (int, float)):
        return float(text)
    number, unit = re.fullmatch(r"\s*([-+0-9.eE]+)\s*(.*?)\s*", text).groups()
    return float(number) * _UNITS[unit]


def quantities(value):
    """'1 mm, 2 mm, 3 mm', or '0, -9.81, 0 m/s^2': a unit at the end serves all; a list likewise."""
    parts = value if isinstance(value, list) else value.split(",")
    unit = re.fullmatch(r"\s*[-+0-9.eE]+\s*(.*?)\s*", str(parts[-1])).group(1)
    return [quantity(f"{p} {unit}" if re.fullmatch(r"\s*[-+0-9.eE]+\s*", str(p)) else p) for p in parts]


class Link:
    def __init__(self, element):
        self.name = element.get("name")
        self.mass, self.centre, self.inertia = 0.0, [0.0, 0.0, 0.0], np.zeros((3, 3))  # about the centre, in the link's axes
        inertial = element.find("inertial")
        if inertial is not None:
            self.mass = float(inertial.find("mass").get("value"))
            origin = inertial.find("origin")
            if origin is not None:
                self.centre = [float(v) for v in origin.get("xyz", "0 0 0").split()]
            i = inertial.find("inertia")
            xx, yy, zz, xy, xz, yz = (float(i.get(k)) for k in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"))
            R = from_fixed_xyz([float(v) for v in (origin.get("rpy", "0 0 0") if origin is not None else "0 0 0").split()])
            self.inertia = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T


class Joint:
    def __init__(self, element):
        self.name, self.type = element.get("name"), element.get("type")
        self.parent, self.child = element.find("parent").get("link"), element.find("child").get("link")
        origin, axis = element.find("origin"), element.find("axis")
        floats = lambda text: [float(v) for v in text.split()]
        self.X_PF = Pose() if origin is None else Pose(from_fixed_xyz(floats(origin.get("rpy", "0 0 0"))), floats(origin.get("xyz", "0 0 0")))
        self.axis = [1.0, 0.0, 0.0] if axis is None else floats(axis.get("xyz"))

    def coordinates(self):
        """Names as in motion.sto; the order is that of the joint's axes."""
        names = {"floating": ["rx", "ry", "rz", "x", "y", "z"], "revolute": ["angle"], "continuous": ["angle"], "prismatic": ["translation"]}
        return [f"{self.name}.{n}" for n in names.get(self.type, [])]


class Urdf:
    def __init__(self, file):
        root = xml.parse(file).getroot()
        self.links = {e.get("name"): Link(e) for e in root.findall("link")}
        joints = [Joint(e) for e in root.findall("joint")]
        self.joint_of = {j.child: j for j in joints}
        self.root = next(n for n in self.links if n not in self.joint_of)
        self.joints, reached = [], {self.root}  # parents before children
        while len(self.joints) < len(joints):
            for j in joints:
                if j not in self.joints and j.parent in reached:
                    self.joints.append(j)
                    reached.add(j.child)

    def moving_link(self, link):
        """The link at the end of the fixed joints above `link`, and the pose of `link` in it."""
        X = Pose()
        while link in self.joint_of and self.joint_of[link].type == "fixed":
            X = self.joint_of[link].X_PF * X
            link = self.joint_of[link].parent
        return link, X


class Wrap:
    def __init__(self, name, given):
        self.name, self.body = name, given["body"]
        six = quantities(given["pose"]) if "pose" in given else [0.0] * 6
        self.X_BW = Pose(from_body_xyz(six[:3]), six[3:])
        self.shape = next(s for s in ("cylinder", "sphere", "ellipsoid") if s in given)
        self.size = [quantity(given[self.shape][k]) for k in (("a", "b", "c") if self.shape == "ellipsoid" else ("R",))]
        side = given.get("side")
        axes = {"x": [1, 0, 0], "-x": [-1, 0, 0], "y": [0, 1, 0], "-y": [0, -1, 0]}
        self.side = None if side is None else axes[side] if side in axes else quantities(side)


class PathPoint:
    def __init__(self, given):
        self.body = given["body"]
        self.moving = given.get("moving")
        self.at = quantities(given["at"]) if "at" in given else None


class Element:
    """A ligament, spring or muscle: `given` is its section, `points` and `wraps` (wraps[i] between points i and i + 1, or None) its path."""

    def __init__(self, kind, name, given):
        self.kind, self.name, self.given = kind, name, given
        self.points, self.wraps = [], []
        for item in given["path"]:
            if "wrap" in item:
                self.wraps[-1] = item["wrap"]
            else:
                self.points.append(PathPoint(item))
                self.wraps.append(None)
        self.wraps.pop()

    def is_wrapped(self):
        return any(self.wraps)

    def has_moving_point(self):
        return any(p.moving for p in self.points)

    @staticmethod
    def number_of(value):
        return quantity(value)

    def number(self, key, default=None):
        return quantity(self.given[key]) if key in self.given else default


class Scene:
    def __init__(self, file):
        self.file = pathlib.Path(file)
        self.yaml = yaml.safe_load(self.file.read_text())
        self.urdf = Urdf(self.file.parent / self.yaml["model"]["urdf"])
        gravity = self.yaml["model"].get("gravity", "none")
        self.gravity = [0.0, 0.0, 0.0] if gravity == "none" else quantities(gravity)
        self.wraps = {n: Wrap(n, w) for n, w in self.yaml.get("wraps", {}).items()}
        self.elements = [Element(kind, n, e) for kind in ("ligaments", "springs", "muscles") for n, e in self.yaml.get(kind, {}).items()]
        self.poses = self.yaml.get("poses", {})

    def of(self, kind):
        return [e for e in self.elements if e.kind == kind]

    def coordinates(self):
        return [c for j in self.urdf.joints for c in j.coordinates()]
