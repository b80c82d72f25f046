"""Genu's contact engine through its C interface (contact/include/genu/contact/genu_contact.h): the part of it that is used here."""
import ctypes as c

import numpy as np

_D, _I = c.c_double, c.c_int
_P = c.POINTER(_D)


class _Patch(c.Structure):
    _fields_ = [(n, _I) for n in ("degree_u", "degree_v", "num_u", "num_v", "num_knots_u", "num_knots_v", "flip_normal")] + [
        (n, _P) for n in ("knots_u", "knots_v", "points", "weights")]


class _Thickness(c.Structure):
    _fields_ = [("kind", _I), ("value", _D), ("back", c.c_void_p), ("min", _D), ("max", _D), ("missing", _D), ("samples_u", _I), ("samples_v", _I)]


class _Material(c.Structure):
    _fields_ = [("law", _I)] + [(n, _D) for n in ("youngs_modulus", "poisson_ratio", "eps0", "p0", "n")]


class _Compartment(c.Structure):
    _fields_ = [("name", c.c_char_p)] + [(n, _D) for n in ("x0", "x1", "z0", "z1")] + [("nx", _I), ("nz", _I), ("fixed", c.c_void_p), ("moving", c.c_void_p)]


class _Options(c.Structure):
    _fields_ = [("struct_size", c.c_size_t), ("compartments", c.POINTER(_Compartment)), ("num_compartments", _I), ("use_element_plane", _I),
                ("element_plane_y", _D), ("fixed_thickness", _Thickness), ("moving_thickness", _Thickness), ("material", _Material),
                ("moving_material", c.c_void_p), ("strain", _I), ("correction", _I), ("rule", _I), ("tracking", _I), ("copy_tolerance", _D),
                ("distance", _I), ("grid_on", _I), ("element_surfaces", c.c_void_p), ("fixed_round_back", c.c_void_p),
                ("moving_round_back", c.c_void_p), ("damping", _D)]


class _Load(c.Structure):
    _fields_ = [("force", _D * 3), ("moment", _D * 3), ("force_on_fixed", _D * 3), ("moment_on_fixed", _D * 3), ("scalar_force", _D),
                ("peak_pressure", _D), ("peak_point", _D * 3), ("mean_pressure", _D), ("area", _D), ("energy", _D), ("max_strain", _D),
                ("center_of_pressure", _D * 3)] + [(n, _I) for n in (
                    "active", "extrapolated", "full_penetration", "not_converged", "boundary", "no_thickness")]


class _Result(c.Structure):
    _fields_ = [("struct_size", c.c_size_t), ("total", _Load), ("power", _D), ("stiffness", _D * 36), ("queries", _I), ("copied", _I), ("damping", _D * 36)]


def _doubles(array):
    flat = np.ascontiguousarray(array, float)
    return flat.ctypes.data_as(_P), flat


class Engine:
    """A case on grids of n by n elements, or n by m."""

    def __init__(self, library, case, n, m=None):
        self._lib = c.CDLL(str(library))
        self._lib.genu_last_error.restype = c.c_char_p
        self._lib.genu_version.restype = c.c_char_p
        self.version = self._lib.genu_version().decode()
        compartments = self._compartments(case, n, m or n)
        options = _Options()
        self._lib.genu_pair_options_init(c.byref(options), c.c_size_t(c.sizeof(_Options)))
        options.compartments, options.num_compartments = compartments, len(compartments)
        options.fixed_thickness.kind, options.fixed_thickness.value = 1, case.h_m
        options.material.youngs_modulus, options.material.poisson_ratio = case.E, case.nu
        options.copy_tolerance = -1
        self._pair, self._workspace = c.c_void_p(), c.c_void_p()
        self._check(self._lib.genu_pair_create(c.byref(options), c.byref(self._pair)))
        self._check(self._lib.genu_workspace_create(self._pair, c.byref(self._workspace)))
        self.result = _Result()
        self._lib.genu_result_init(c.byref(self.result), c.c_size_t(c.sizeof(_Result)))
        self._call = self._lib.genu_evaluate
        self._argument = (_D * 6)()

    def _check(self, status):
        if status >= 10:
            raise RuntimeError(self._lib.genu_last_error().decode())

    def _surface(self, patches):
        kept, made = [], (_Patch * len(patches))()
        for out, p in zip(made, patches):
            (out.degree_u, out.degree_v), (out.num_u, out.num_v) = p.degree, p.points.shape[:2]
            out.num_knots_u, out.num_knots_v, out.flip_normal = len(p.knots[0]), len(p.knots[1]), int(p.flip)
            for name, values in (("knots_u", p.knots[0]), ("knots_v", p.knots[1]), ("points", p.points), ("weights", p.weights)):
                pointer, array = _doubles(values)
                setattr(out, name, pointer)
                kept.append(array)
        surface = c.c_void_p()
        self._check(self._lib.genu_surface_create_nurbs(made, len(patches), c.byref(surface)))
        return surface.value

    def _compartments(self, case, n, m):
        made = (_Compartment * len(case.layers))()
        if hasattr(case, "patches"):
            surfaces = {name: self._surface(p) for name, p in case.patches.items()}
            rows = [(name, surfaces[f], surfaces[s], r) for name, f, s, r in case.compartments]
        else:
            plane, sphere = c.c_void_p(), c.c_void_p()
            self._check(self._lib.genu_surface_create_plane(_D(case.h_m), _D(0), _D(0), 0, _D(0.05), c.byref(plane)))
            self._check(self._lib.genu_surface_create_sphere(_D(case.radius_m), c.byref(sphere)))
            rows = [(l.name, plane.value, sphere.value, l.rectangle) for l in case.layers]
        for out, (name, fixed, moving, r) in zip(made, rows):
            out.name, out.nx, out.nz, out.fixed, out.moving = name.encode(), n, m, fixed, moving
            out.x0, out.x1, out.z0, out.z1 = r
        return made

    def evaluate(self, pose):
        self._argument[:] = pose
        status = self._call(self._pair, self._workspace, self._argument, None, None, c.byref(self.result), None, 0)
        if status:
            raise RuntimeError(f"status {status}: {self._lib.genu_last_error().decode()}")

    def load(self):
        t = self.result.total
        return {"force": list(t.force), "moment": list(t.moment), "area": t.area, "peak": t.peak_pressure}
