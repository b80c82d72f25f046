"""A case in OpenSim: ElasticFoundationForce between ContactMeshes (Sherman et al. 2011, Procedia IUTAM 2:241, and Simbody's documentation)."""
import pathlib

import numpy as np
import opensim

from . import meshes

opensim.Logger.setLevelString("error")

COORDINATES = ("rx", "ry", "rz", "x", "y", "z")


def _vec3(v):
    return opensim.Vec3(float(v[0]), float(v[1]), float(v[2]))


class OpenSimKnee:
    """link: mass properties of the moving body, or None. Pressure is K / h times the distance, on all meshes; no damping, no friction.
    close_m: the depth of the copies that close the meshes."""

    close_m = 0.008

    def __init__(self, case, edge_m, folder, link=None, held=None, damping=None, prescribed=None):
        folder = pathlib.Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        self.model = opensim.Model()
        self.model.setGravity(opensim.Vec3(0))
        if link is None:
            self.body = opensim.Body("moving", 1.0, opensim.Vec3(0), opensim.Inertia(1e-3, 1e-3, 1e-3, 0, 0, 0))
        else:
            I = link.inertia
            self.body = opensim.Body("moving", link.mass, _vec3(link.centre), opensim.Inertia(I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]))
        self.model.addBody(self.body)
        transform = opensim.SpatialTransform()
        for k, name in enumerate(COORDINATES):
            axis = getattr(transform, f"upd_{'rotation' if k < 3 else 'translation'}{k % 3 + 1}")()
            if name in (held or {}):
                axis.set_function(opensim.Constant(held[name]))
            else:
                axis.setCoordinateNames(opensim.ArrayStr(name, 1))
                axis.set_function(opensim.LinearFunction(1, 0))
            axis.setAxis(_vec3([float(i == k % 3) for i in range(3)]))
        self.model.addJoint(opensim.CustomJoint("joint", self.model.getGround(), opensim.Vec3(0), opensim.Vec3(0), self.body, opensim.Vec3(0),
                                                opensim.Vec3(0), transform))
        self.held = held or {}
        coordinates = self.model.getCoordinateSet()
        for name, value in (damping or {}).items():
            force = opensim.SpringGeneralizedForce(name)
            force.setStiffness(0.0)
            force.setViscosity(value)
            self.model.addForce(force)
        for name in COORDINATES if prescribed is not None else ():
            if name in prescribed.prescribed:
                spline = opensim.SimmSpline()
                for t in np.linspace(-0.01, prescribed.cycle_s + 0.01, int(round(1000 * prescribed.cycle_s)) + 21):
                    spline.addPoint(float(t), float(prescribed.prescribed[name](t)))
                coordinates.get(name).setPrescribedFunction(spline)
                coordinates.get(name).set_prescribed(True)
        self.triangles, self.forces = 0, []
        sheets = [(self.model.getGround(), f"layer_{k}", l, case.h_m) for k, l in enumerate(case.layers)]
        sheets += [(self.body, f"moving_{k}", m, self.close_m) for k, m in enumerate(case.moving)]
        names = []
        for body, name, made, depth in sheets:
            vertices, triangles = meshes.closed(*made.mesh(edge_m), depth)
            file = folder / f"{name}.obj"
            meshes.write_obj(file, vertices, triangles)
            self.triangles += len(triangles)
            geometry = opensim.ContactMesh(str(file), opensim.Vec3(0), opensim.Vec3(0), body)
            geometry.setName(name)
            self.model.addContactGeometry(geometry)
            names.append(name)
        # A force for every pair that can touch: its meshes are all it looks at.
        for k, layer in enumerate(case.layers):
            middle = 0.5 * (layer.rectangle[2] + layer.rectangle[3])
            near = min(range(len(case.moving)), key=lambda i: abs(_middle_z(case.moving[i]) - middle))
            force = opensim.ElasticFoundationForce()
            for geometry in (f"layer_{k}", f"moving_{near}"):
                force.addGeometry(geometry)
            force.setStiffness(case.K_Pa / case.h_m)
            for none in (force.setDissipation, force.setStaticFriction, force.setDynamicFriction, force.setViscousFriction):
                none(0.0)
            force.setName(f"contact_{k}")
            self.model.addForce(force)
            self.forces.append(force)

    def start(self):
        self.state = self.model.initSystem()
        coordinates = self.model.getCoordinateSet()
        self.coordinates = {n: coordinates.get(n) for n in COORDINATES if n not in self.held}
        return self.state

    def place(self, pose):
        for name, value in zip(COORDINATES, pose):
            if name in self.coordinates:
                self.coordinates[name].setValue(self.state, float(value), False)

    def set_rates(self, rates):
        for name, value in zip(COORDINATES, rates):
            if name in self.coordinates:
                self.coordinates[name].setSpeedValue(self.state, float(value))

    def read(self):
        """Coordinates in Genu's order."""
        return [self.coordinates[n].getValue(self.state) if n in self.coordinates else self.held[n] for n in COORDINATES]

    def speed(self):
        """Largest rate [m/s]; angles times 25 mm."""
        return max(abs(c.getSpeedValue(self.state)) * (0.025 if n[0] == "r" else 1) for n, c in self.coordinates.items())

    def evaluate(self):
        self.model.realizeDynamics(self.state)

    def load(self):
        """Force on the moving body in ground and moment about the fixed origin; the program gives neither area nor peak pressure."""
        force, moment, vertical = np.zeros(3), np.zeros(3), []
        for f in self.forces:
            labels, values = f.getRecordLabels(), f.getRecordValues(self.state)
            row = {labels.get(i): values.get(i) for i in range(labels.getSize())}
            vertical.append(sum(v for k, v in row.items() if k.endswith("moving.force.Y")))
            for axis in range(3):
                force[axis] += sum(v for k, v in row.items() if k.endswith(f"moving.force.{'XYZ'[axis]}"))
                moment[axis] += sum(v for k, v in row.items() if k.endswith(f"moving.torque.{'XYZ'[axis]}"))
        # The torque is about the moving body's origin.
        origin = np.array(self.read()[3:])
        return {"force": force.tolist(), "moment": (moment + np.cross(origin, force)).tolist(), "area": None, "peak": None, "vertical": vertical}


def _middle_z(sheet):
    return float(np.mean(sheet.mesh(0.01)[0][..., 2]))
