"""A case in Drake: the layer a compliant hydroelastic mesh, the moving body a rigid one (Elandt et al. 2019, IROS; Masterjohn et al. 2022, RA-L)."""
import importlib.metadata
import pathlib

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import (AddCompliantHydroelasticProperties, AddCompliantHydroelasticPropertiesForHalfSpace, AddRigidHydroelasticProperties,
                              HalfSpace, Mesh, ProximityProperties)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import AddMultibodyPlant, CoulombFriction, ExternallyAppliedSpatialForce, MultibodyPlantConfig
from pydrake.multibody.tree import FixedOffsetFrame, PdControllerGains, PrismaticJoint, RevoluteJoint, RotationalInertia, SpatialInertia, UnitInertia
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from . import meshes

# In the order of the chain from the fixed to the moving body: R = Rx Ry Rz after the translation, as in Genu.
AXES = (("x", PrismaticJoint, [1, 0, 0]), ("y", PrismaticJoint, [0, 1, 0]), ("z", PrismaticJoint, [0, 0, 1]),
        ("rx", RevoluteJoint, [1, 0, 0]), ("ry", RevoluteJoint, [0, 1, 0]), ("rz", RevoluteJoint, [0, 0, 1]))
COORDINATES = ("rx", "ry", "rz", "x", "y", "z")  # Genu's order


class Load(LeafSystem):
    """A force in the fixed frame at a point of the moving body, over time."""

    def __init__(self, body, point, force_at):
        super().__init__()
        self._body, self._point, self._force_at = body, point, force_at
        self.DeclareAbstractOutputPort("force", lambda: Value[list[ExternallyAppliedSpatialForce]](), self._calc)

    def _calc(self, context, out):
        applied = ExternallyAppliedSpatialForce()
        applied.body_index = self._body.index()
        applied.p_BoBq_B = self._point
        applied.F_Bq_W = SpatialForce(np.zeros(3), self._force_at(context.get_time()))
        out.set_value([applied])


def version():
    return importlib.metadata.version("drake")


def _properties(set_hydroelastic):
    properties = ProximityProperties()
    set_hydroelastic(properties)
    properties.AddProperty("material", "coulomb_friction", CoulombFriction(0.0, 0.0))
    properties.AddProperty("material", "hunt_crossley_dissipation", 0.0)
    properties.AddProperty("material", "relaxation_time", 0.0)
    return properties


def _deepest_layer(points, normals, h_m):
    """The layer's mesh, as deep as h or the largest half, quarter, ... of it that the surface's curvature permits; its depth [m]. The modulus goes
    with it, so that the pressure does not change."""
    for depth in (h_m, h_m / 2, h_m / 4, h_m / 8):
        try:
            return *meshes.layer(points, normals, depth), depth
        except ValueError as error:
            reason = error
    raise reason


class DrakeModel:
    """time_step 0: continuous. No friction, no dissipation; damping: of joints [N s/m, N m s/rad], by name. welded: coordinates that are held
    at a value [m, rad]; driven: coordinates that follow a trajectory (curves by name), by stiff controllers which Drake treats implicitly.
    representation: 'polygon' or 'triangle' faces of the contact surface. layer_edge_m: of the layer's mesh; None: edge_m. half_space: the
    layer is Drake's own half space, for a flat one."""

    # Stiff enough that what they give way does not count beside the errors measured; each run tells it.
    drive_stiffness, drive_damping = {"x": 1e8, "ry": 1e5, "rz": 1e5}, {"x": 1e5, "ry": 1e2, "rz": 1e2}

    def __init__(self, case, edge_m, folder, time_step=0.0, representation="polygon", approximation="lagged", welded=None, driven=None, inertia=None,
                 damping=None, layer_edge_m=None, half_space=False):
        folder = pathlib.Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        self.builder = DiagramBuilder()
        config = MultibodyPlantConfig(time_step=time_step, contact_model="hydroelastic", contact_surface_representation=representation,
                                      discrete_contact_approximation=approximation, sap_near_rigid_threshold=0.0,
                                      use_sampled_output_ports=False)
        self.plant, self.scene_graph = AddMultibodyPlant(config, self.builder)
        plant = self.plant
        plant.mutable_gravity_field().set_gravity_vector([0, 0, 0])
        welded = welded or {}
        self.welded = welded
        # Bodies between the joints weigh nothing; CENIC, of which time_step 0 may be integrated, takes none without mass.
        light = 1e-6
        between = SpatialInertia.Zero() if time_step else SpatialInertia(light, np.zeros(3), UnitInertia(1e-4, 1e-4, 1e-4))
        parent = plant.world_frame()
        X = RigidTransform()
        self.joints = {}
        for name, kind, axis in AXES:
            if name in welded:
                if kind is PrismaticJoint:
                    X = X @ RigidTransform(np.multiply(axis, welded[name]))
                else:
                    make = {"rx": RotationMatrix.MakeXRotation, "ry": RotationMatrix.MakeYRotation, "rz": RotationMatrix.MakeZRotation}[name]
                    X = X @ RigidTransform(make(welded[name]))
                continue
            body = plant.AddRigidBody(f"after_{name}", between)
            frame = plant.AddFrame(FixedOffsetFrame(f"before_{name}", parent, X))
            self.joints[name] = plant.AddJoint(kind(name, frame, body.body_frame(), axis, damping=(damping or {}).get(name, 0.0)))
            parent, X = body.body_frame(), RigidTransform()
        self.body = plant.AddRigidBody("moving", inertia or SpatialInertia(1.0, np.zeros(3), UnitInertia(1e-3, 1e-3, 1e-3)))
        plant.WeldFrames(parent, self.body.body_frame(), X)
        self.driven = [name for name, _, _ in AXES if name in (driven or {})]
        for name in self.driven:
            actuator = plant.AddJointActuator(f"drive_{name}", self.joints[name])
            actuator.set_controller_gains(PdControllerGains(p=self.drive_stiffness[name], d=self.drive_damping[name]))
        self.curves, self._load = driven or {}, None
        self.tetrahedra = self.triangles = 0
        if half_space:
            properties = _properties(lambda p: AddCompliantHydroelasticPropertiesForHalfSpace(case.h_m, case.K_Pa, p))
            plant.RegisterCollisionGeometry(plant.world_body(), RigidTransform(RotationMatrix.MakeXRotation(-np.pi / 2), [0, case.h_m, 0]), HalfSpace(),
                                            "layer", properties)
        for k, layer in enumerate([] if half_space else case.layers):
            vertices, tetrahedra, depth = _deepest_layer(*layer.mesh(layer_edge_m or edge_m), case.h_m)
            file = folder / f"layer_{k}.vtk"
            meshes.write_vtk(file, vertices, tetrahedra)
            self.tetrahedra += len(tetrahedra)
            self._add(plant.world_body(), file, f"layer_{k}", lambda p: AddCompliantHydroelasticProperties(1.0, case.K_Pa * depth / case.h_m, p))
        for k, moving in enumerate(case.moving):
            vertices, triangles = meshes.sheet(*moving.mesh(edge_m))
            file = folder / f"moving_{k}.obj"
            meshes.write_obj(file, vertices, triangles)
            self.triangles += len(triangles)
            self._add(self.body, file, f"moving_{k}", lambda p: AddRigidHydroelasticProperties(p))

    def _add(self, body, file, name, set_properties):
        self.plant.RegisterCollisionGeometry(body, RigidTransform(), Mesh(str(file)), name, _properties(set_properties))

    def add_load(self, point, force_at):
        self._load = self.builder.AddSystem(Load(self.body, point, force_at))

    def start(self, duration_s=1.0, lead_s=0.0):
        """lead_s: a step's controllers see the trajectory this much later, so that they aim at the step's end."""
        self.plant.Finalize()
        if self._load is not None:
            self.builder.Connect(self._load.get_output_port(0), self.plant.get_applied_spatial_force_input_port())
        if self.driven:
            knots = np.unique(np.concatenate([self.curves[n].t for n in self.driven if hasattr(self.curves[n], "t")] + [[0.0, duration_s]]))
            q, v = (np.array([self.curves[n](knots, k) for n in self.driven]) for k in (0, 1))
            path = PiecewisePolynomial.CubicHermite(knots - lead_s, q, v)  # the same cubics
            source = self.builder.AddSystem(TrajectorySource(path, 1))
            self.builder.Connect(source.get_output_port(), self.plant.get_desired_state_input_port(self.body.model_instance()))
        self.diagram = self.builder.Build()
        self.root = self.diagram.CreateDefaultContext()
        self.context = self.plant.GetMyMutableContextFromRoot(self.root)

    def place(self, pose):
        for name, value in zip(COORDINATES, pose):
            if name in self.joints:
                joint = self.joints[name]
                (joint.set_angle if isinstance(joint, RevoluteJoint) else joint.set_translation)(self.context, value)

    def set_rates(self, rates):
        for name, value in zip(COORDINATES, rates):
            if name in self.joints:
                joint = self.joints[name]
                (joint.set_angular_rate if isinstance(joint, RevoluteJoint) else joint.set_translation_rate)(self.context, value)

    def use(self, context):
        """Another diagram's context, a Simulator's, for what follows."""
        self.root, self.context = context, self.plant.GetMyMutableContextFromRoot(context)

    def read(self):
        """Coordinates in Genu's order."""
        value = lambda j: (j.get_angle if isinstance(j, RevoluteJoint) else j.get_translation)(self.context)
        return [value(self.joints[n]) if n in self.joints else self.welded[n] for n in COORDINATES]

    def speed(self):
        """Largest rate [m/s]; angles times 25 mm."""
        rate = lambda j: 0.025 * j.get_angular_rate(self.context) if isinstance(j, RevoluteJoint) else j.get_translation_rate(self.context)
        return max(abs(rate(j)) for j in self.joints.values())

    def evaluate(self):
        return self.plant.get_contact_results_output_port().Eval(self.context)

    def load(self, results=None):
        results = results or self.evaluate()
        force, moment, area, peak, faces, pairs = np.zeros(3), np.zeros(3), 0.0, 0.0, 0, []
        moving = set(self.plant.GetCollisionGeometriesForBody(self.body))
        for k in range(results.num_hydroelastic_contacts()):
            info = results.hydroelastic_contact_info(k)
            surface = info.contact_surface()
            F = info.F_Ac_W()
            sign = 1.0 if surface.id_M() in moving else -1.0
            force += sign * F.translational()
            moment += sign * (F.rotational() + np.cross(surface.centroid(), F.translational()))
            area += surface.total_area()
            pairs.append((surface.centroid()[2], sign * F.translational()[1]))
            field = surface.tri_e_MN() if surface.is_triangle() else surface.poly_e_MN()
            peak = max([peak] + [field.EvaluateAtVertex(i) for i in range(surface.num_vertices())])
            faces += surface.num_faces()
        return {"force": force.tolist(), "moment": moment.tolist(), "area": area, "peak": peak, "faces": faces, "pairs": pairs}


def inertia_of(link):
    I = link.inertia
    return SpatialInertia.MakeFromCentralInertia(link.mass, np.array(link.centre), RotationalInertia(I[0, 0], I[1, 1], I[2, 2], I[0, 1], I[0, 2], I[1, 2]))
