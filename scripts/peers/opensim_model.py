"""Builds an OpenSim model from a Genu scene: bodies, joints, wraps, ligaments, muscles. Contact, loads and springs are left out."""
import math

import numpy as np
import opensim

from .rotation import Pose, about, to_body_xyz, with_z_along

opensim.Logger.setLevelString("error")

# A cylinder of Genu has no ends.
_LONG = 10.0
# Of Millard's muscle, whose compliant form divides by the activation.
_LEAST_ACTIVATION = 0.01


def _vec3(v):
    return opensim.Vec3(float(v[0]), float(v[1]), float(v[2]))


class OpenSimModel:
    """muscle: 'de-groote' or 'millard'. tendon: 'rigid', 'compliant', or None: as the scene says. copies: of every element."""

    def __init__(self, scene, muscle="de-groote", tendon=None, copies=1, kinds=("ligaments", "muscles")):
        self.scene = scene
        self.model = opensim.Model()
        self.model.setGravity(_vec3(scene.gravity))
        self._bodies = {scene.urdf.root: self.model.updGround()}
        self._wraps = {}
        self._options = (muscle, tendon)
        self.coordinate_names = []
        for joint in scene.urdf.joints:
            if joint.type != "fixed":
                self._add_joint(joint)
        self.forces = {}
        elements = [e for e in scene.elements if e.kind in kinds]
        for copy in range(copies):
            for element in elements:
                self._add_element(element, element.name if copy == 0 else f"{element.name}_{copy}")

    def start(self):
        """The model takes what was added; returns the state."""
        self.model.finalizeConnections()
        self.state = self.model.initSystem()
        self.coordinates = {c.getName(): c for c in self.model.getCoordinateSet()}
        return self.state

    def place(self, values, rates):
        """By name of the coordinate [m, rad and per second]."""
        for name, c in self.coordinates.items():
            c.setValue(self.state, float(values[name]), False)
            c.setSpeedValue(self.state, float(rates[name]))

    def _frame(self, link):
        """The body that carries a link, and the link's pose in it."""
        link, X = self.scene.urdf.moving_link(link)
        return self._bodies[link], X

    def _add_joint(self, joint):
        body = opensim.Body(joint.child, *self._mass_properties(joint.child))
        self.model.addBody(body)
        self._bodies[joint.child] = body
        parent, X_BP = self._frame(joint.parent)
        X_BF = X_BP * joint.X_PF
        names = joint.coordinates()
        safe = [n.replace(".", "_") for n in names]
        if joint.type == "floating":
            transform = opensim.SpatialTransform()
            for k, name in enumerate(safe):
                axis = getattr(transform, f"upd_{'rotation' if k < 3 else 'translation'}{k % 3 + 1}")()
                axis.setCoordinateNames(opensim.ArrayStr(name, 1))
                axis.set_function(opensim.LinearFunction(1, 0))
                axis.setAxis(_vec3([float(i == k % 3) for i in range(3)]))
            made = opensim.CustomJoint(joint.name, parent, _vec3(X_BF.p), _vec3(to_body_xyz(X_BF.R)), body, opensim.Vec3(0), opensim.Vec3(0),
                                       transform)
        elif joint.type in ("revolute", "continuous"):
            R = with_z_along(joint.axis)
            made = opensim.PinJoint(joint.name, parent, _vec3(X_BF.p), _vec3(to_body_xyz(X_BF.R @ R)), body, opensim.Vec3(0),
                                    _vec3(to_body_xyz(R)))
            made.updCoordinate().setName(safe[0])
        else:
            raise ValueError(f"joint {joint.name}: {joint.type} is not translated")
        self.model.addJoint(made)
        self.coordinate_names += names

    def _mass_properties(self, carrier):
        """Mass, centre and central inertia of a link together with those fixed to it."""
        parts = []
        for name, link in self.scene.urdf.links.items():
            owner, X = self.scene.urdf.moving_link(name)
            if owner == carrier and link.mass > 0:
                parts.append((link.mass, X.apply(link.centre), X.R @ link.inertia @ X.R.T))
        mass = sum(m for m, _, _ in parts)
        centre = sum(m * c for m, c, _ in parts) / mass
        inertia = sum(I + m * ((c - centre) @ (c - centre) * np.eye(3) - np.outer(c - centre, c - centre)) for m, c, I in parts)
        return mass, _vec3(centre), opensim.Inertia(inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2])

    def _wrap(self, name):
        if name in self._wraps:
            return self._wraps[name]
        given = self.scene.wraps[name]
        body, X_BL = self._frame(given.body)
        X = X_BL * given.X_BW
        if given.shape == "cylinder":
            made = opensim.WrapCylinder()
            made.set_radius(given.size[0])
            made.set_length(_LONG)
            if given.side is not None:
                # Its +x is the side.
                X = X * Pose(about("z", math.atan2(given.side[1], given.side[0])))
                made.set_quadrant("x")
        elif given.shape == "sphere":
            made = opensim.WrapSphere()
            made.set_radius(given.size[0])
        else:
            made = opensim.WrapEllipsoid()
            made.set_dimensions(_vec3(given.size))
        if made.get_quadrant() == "Unassigned":
            made.set_quadrant("all")
        made.setName(name)
        made.set_translation(_vec3(X.p))
        made.set_xyz_body_rotation(_vec3(to_body_xyz(X.R)))
        body.addWrapObject(made)
        self._wraps[name] = made
        return made

    def _add_path(self, path, element):
        for i, point in enumerate(element.points):
            if point.moving:
                raise ValueError(f"{element.name}: moving points are not translated")
            body, X = self._frame(point.body)
            path.appendNewPathPoint(f"p{i}", body, _vec3(X.apply(point.at)))
        for i, wrap in enumerate(element.wraps):
            if wrap is None:
                continue
            path.addPathWrap(self._wrap(wrap))
            used = path.updWrapSet().get(path.getWrapSet().getSize() - 1)
            # Points count from 1.
            span = used.updPropertyByName("range")
            opensim.PropertyHelper.setValueInt(i + 1, span, 0)
            opensim.PropertyHelper.setValueInt(i + 2, span, 1)

    def _add_element(self, element, name):
        made = self._make_ligament(element, name) if element.kind == "ligaments" else self._make_muscle(element, name)
        self._add_path(opensim.GeometryPath.safeDownCast(made.upd_path()), element)
        self.model.addForce(made)
        self.forces[name] = made

    def _make_ligament(self, element, name):
        slack = element.given["slack"]
        if "length" not in slack:
            raise ValueError(f"{element.name}: a slack length is needed, not {slack}")
        ligament = opensim.Blankevoort1991Ligament(name, element.number("stiffness"), element.number_of(slack["length"]))
        ligament.set_transition_strain(2 * element.number("toe_strain", 0.03))  # where the toe ends
        if "damping" in element.given:
            raise ValueError(f"{element.name}: the two damping laws differ")
        ligament.set_damping_coefficient(0.0)
        return ligament

    def _make_muscle(self, element, name):
        kind, tendon = self._options
        muscle = opensim.DeGrooteFregly2016Muscle() if kind == "de-groote" else opensim.Millard2012EquilibriumMuscle()
        muscle.setName(name)
        muscle.set_max_isometric_force(element.number("max_force"))
        muscle.set_optimal_fiber_length(element.number("fibre_length"))
        muscle.set_tendon_slack_length(element.number("tendon_length"))
        muscle.set_pennation_angle_at_optimal(element.number("pennation", 0.0))
        muscle.set_max_contraction_velocity(element.number("max_velocity", 10.0))
        muscle.set_ignore_tendon_compliance((tendon or element.given.get("tendon", "rigid")) == "rigid")
        muscle.set_fiber_damping(element.number("fibre_damping", 0.1))
        activation = element.given.get("activation", {})
        muscle.set_activation_time_constant(element.number_of(activation.get("rise", "15 ms")))
        muscle.set_deactivation_time_constant(element.number_of(activation.get("fall", "60 ms")))
        if kind == "de-groote":
            muscle.set_passive_fiber_strain_at_one_norm_force(element.number("passive_strain", 0.6))
            muscle.set_tendon_strain_at_one_norm_force(element.number("tendon_strain", 0.049))
        else:
            muscle.set_minimum_activation(_LEAST_ACTIVATION)
        muscle.set_min_control(_LEAST_ACTIVATION if kind == "millard" else 0.0)
        return muscle
