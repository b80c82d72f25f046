"""What is compared: compartments with an elastic layer of constant thickness and a rigid body against it."""
import pathlib

import numpy as np
import yaml

from ..scene import Scene, quantities, quantity
from . import nurbs


class PatchSheet:
    """A surface that is meshed whole."""

    def __init__(self, patch):
        self.patch = patch

    def mesh(self, edge_m):
        return self.patch.grid(*(max(2, int(np.ceil(s / edge_m))) for s in self.patch.sizes()))


class SphereSheet:
    """The lower cap of a sphere about the origin, 30 degrees wide."""

    def __init__(self, radius_m):
        self.radius_m = radius_m

    def mesh(self, edge_m):
        reach = np.radians(15)
        a = np.linspace(-reach, reach, max(2, int(np.ceil(2 * reach * self.radius_m / edge_m))) + 1)
        U, V = np.meshgrid(a, a, indexing="ij")
        n = np.stack([np.tan(U), -np.ones_like(U), np.tan(V)], axis=2)
        n /= np.linalg.norm(n, axis=2, keepdims=True)
        return self.radius_m * n, n


class Layer:
    """Fixed surface over a rectangle x0, x1, z0, z1 [m]; patch None: the plane y = height."""

    def __init__(self, name, rectangle, patch=None, height_m=None):
        self.name, self.rectangle, self.patch, self.height_m = name, rectangle, patch, height_m

    def mesh(self, edge_m):
        x0, x1, z0, z1 = self.rectangle
        x, z = (np.linspace(a, b, max(2, int(np.ceil((b - a) / edge_m))) + 1) for a, b in ((x0, x1), (z0, z1)))
        if self.patch is not None:
            return self.patch.above(x, z)
        X, Z = np.meshgrid(x, z, indexing="ij")
        return np.stack([X, np.full_like(X, self.height_m), Z], axis=2), np.broadcast_to([0.0, 1.0, 0.0], X.shape + (3,))


class Case:
    """layers, moving: what is meshed; h_m: thickness; K_Pa: confined modulus [BF2004 eq. 2]. length_m turns angles and moments into lengths
    and forces."""

    length_m = 0.025

    def set_material(self, E, nu):
        self.E, self.nu = E, nu
        self.K_Pa = (1 - nu) * E / ((1 + nu) * (1 - 2 * nu))


class SphereCase(Case):
    """A sphere pressed into a flat layer, whose force each model has in closed form."""

    def __init__(self):
        self.name, self.title = "sphere", "sphere on a flat layer"
        self.radius_m, self.h_m, self.depth_m = 0.030, 0.006, 0.0002
        self.set_material(463e6, 0.46)
        self.layers = [Layer("layer", (-0.007, 0.007, -0.007, 0.007), height_m=self.h_m)]
        self.moving = [SphereSheet(self.radius_m)]

    def poses(self):
        """Centres that move over the grid: no mesh or grid is favoured by symmetry. [rx, ry, rz, x, y, z]"""
        y = self.h_m + self.radius_m - self.depth_m
        return [np.array([0.01 * np.sin(k), 0.02 * k, 0.015 * np.cos(2 * k), 0.0007 * np.sin(3 * k), y, 0.0009 * np.cos(5 * k)]) for k in range(10)]

    def closed_form(self, law):
        """Vertical force [N]. midsurface: closest distance over the cosine of half the angle, force along the bisector; vertical: distance
        along y, force along the sphere's normal on its area (the springs fill the cap); both meshes: the mean of springs on the plane, to the
        nearest point of the sphere, and of springs on the sphere, to the nearest point of the plane."""
        k, R, D = self.K_Pa / self.h_m, self.radius_m, self.depth_m
        if law == "midsurface":
            return np.pi * k * D**2 * (R - 2 * D / 3)
        if law == "vertical":
            return np.pi * k * D**2 * (R - D / 3)
        # rho^2 = r^2 + a^2, w^2 = R^2 - r^2, a = R - D: the plane's give 2 pi k a int_a^R (R - rho) d rho = pi k a D^2, the sphere's
        # 2 pi k R int_a^R (w - a) d w = pi k R D^2.
        return np.pi * k * D**2 * (R - D / 2)


def _inside(rectangle, patch):
    """The rectangle, or a smaller one that the patch covers wholly, as a mesh needs it; Genu then computes on the same."""
    x0, x1, z0, z1 = rectangle
    for shrink in np.arange(0, 5e-3, 0.5e-3):
        r = (x0 + shrink, x1 - shrink, z0 + shrink, z1 - shrink)
        try:
            Layer("", r, patch).mesh(2e-3)
            return r
        except ValueError:
            pass
    raise ValueError("a rectangle lies beside its surface")


# Knees whose gait is damped in z, in all programs. Undamped, the implant's soft motion in z amplifies every difference: Genu's own runs with accuracy 1e-5 on 30 x 30 and 1e-6 on
# 120 x 120 elements part by 2.2 mm, so that an error would say nothing of the contact.
DAMPED = ("tka_dm",)


class KneeCase(Case):
    """A knee's scene with one contact pair; the layer's thickness becomes that of its thinnest place, because neither peer has a local one."""

    def __init__(self, file, data=None, joint="tibiofemoral"):
        self.file = pathlib.Path(file).resolve()
        self.data = data
        self.scene = Scene(self.file)
        self.yaml = self.scene.yaml
        self.name = self.file.parent.name
        self.title = self.yaml["name"]
        contact = self.yaml["contact"][joint]
        material = self.yaml["materials"][contact["material"]]
        self.set_material(quantity(material["E"]), quantity(material["nu"]))
        patches = {n: nurbs.read(self.file.parent / s["nurbs"]) for n, s in self.yaml["surfaces"].items()}
        self.files = {n: self.file.parent / s["nurbs"] for n, s in self.yaml["surfaces"].items()}
        self.layers, self.moving, used = [], [], set()
        self.compartments, self.shrunk_mm = [], 0.0
        for name, c in contact["compartments"].items():
            fixed, moving = c.get("fixed", contact["fixed"].get("surface")), c.get("moving", contact["moving"].get("surface"))
            rectangle = quantities(c["rectangle"])
            middle = 0.5 * (rectangle[2] + rectangle[3])
            patch = next(p for p in patches[fixed] if p.points[..., 2].min() < middle < p.points[..., 2].max())
            asked, rectangle = rectangle, _inside(rectangle, patch)
            self.shrunk_mm = max(self.shrunk_mm, round(1e3 * (rectangle[0] - asked[0]), 3))
            self.compartments.append((name, fixed, moving, rectangle))
            self.layers.append(Layer(name, rectangle, patch))
            if moving not in used:
                used.add(moving)
                self.moving += [PatchSheet(p) for p in patches[moving]]
        self.h_m = round(min(layer.mesh(0.5e-3)[0][..., 1].min() for layer in self.layers), 5)
        self.patches = patches

    def gait_damping(self):
        """Arguments of a gait: the damper on z [N s/m], 300/s times the mass of the loaded body, where there is one."""
        (load,) = self.yaml["loads"].values()
        return {"damping_z": round(300 * self.scene.urdf.links[load["body"]].mass, 3)} if self.name in DAMPED else {}

    def write_scene(self, file, local_thickness=False, start=None, damping_z=None, correction=None, **changes):
        """The scene with absolute paths, the meshed rectangles, the constant thickness, starting values of free coordinates, a damper on z
        [N s/m], the contact's `correction` and the given sections of `analysis`. Returns the file."""
        given = yaml.safe_load(self.file.read_text())
        for s in given["surfaces"].values():
            s["nurbs"] = str((self.file.parent / s["nurbs"]).resolve())
        given["model"]["urdf"] = str((self.file.parent / given["model"]["urdf"]).resolve())

        def absolute(value):
            if isinstance(value, dict):
                for k, v in value.items():
                    if k == "table" and not v.startswith("data:"):
                        value[k] = str((self.file.parent / v).resolve())
                    absolute(v)
            elif isinstance(value, list):
                for v in value:
                    absolute(v)

        absolute(given)
        for contact in given["contact"].values():
            for name, _, _, rectangle in self.compartments:
                contact["compartments"][name]["rectangle"] = ", ".join(f"{1e3 * v:.12g} mm" for v in rectangle)
            if correction:
                contact["correction"] = correction
            if not local_thickness:
                contact["fixed"]["thickness"] = f"{1e3 * self.h_m:.12g} mm"
        for name, value in (start or {}).items():
            given["model"]["coordinates"][name] = {"free": {"start": f"{value:.12g} {'rad' if name[0] == 'r' else 'm'}"}}
        if damping_z:
            given["model"]["coordinates"]["z"] = {"free": {"start": "0 mm", "damping": f"{damping_z:.12g} N s/m"}}
        given.setdefault("analysis", {}).update(changes)
        file = pathlib.Path(file)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(yaml.safe_dump(given, sort_keys=False))
        return file
