"""The three comparisons: rows of program, setting, time and errors, from the cases that are kept."""
import numpy as np

from . import limited, plan
from .case import KneeCase, SphereCase
from .kept import NotMeasured
from .limited import NotFinished
from .motion import Scene
from .own_runs import Program


class Row:
    """errors: name -> value, None where the program does not give it. note: why a run has no result. fineness: of grid or mesh, in a family of settings
    that differ in nothing else."""

    def __init__(self, program, setting, time_s=None, errors=None, note="", fineness=0.0, family="", **more):
        self.program, self.setting, self.time_s, self.errors, self.note, self.more = program, setting, time_s, errors or {}, note, more
        self.fineness, self.family = fineness, family

    def fell(self):
        """Through the layer: its thickness is some millimetres."""
        return bool(self.time_s) and self.errors.get("pose", 0.0) > 10


def _kind(job):
    """Fineness and family of a job's row."""
    others = {k: v for k, v in job.options.items() if k not in ("edge_m", "grid")}
    return {"fineness": 1 / job.edge_mm if job.edge_mm else job.options["grid"], "family": repr(sorted(others.items()))}


def _errors_of_loads(loads, references, length_m):
    """Root mean squares over the poses [%]: force; moment about the fixed origin over force times length_m; area; peak pressure."""
    rms = lambda values: None if any(v is None for v in values) else 100 * float(np.sqrt(np.mean(np.square(values))))
    pairs = list(zip(loads, references))
    size = lambda r: np.linalg.norm(r["force"])
    relative = lambda k: [None if a[k] is None or b[k] is None else a[k] / b[k] - 1 for a, b in pairs]
    return {"force": rms([np.linalg.norm(np.subtract(a["force"], b["force"])) / size(b) for a, b in pairs]),
            "moment": rms([np.linalg.norm(np.subtract(a["moment"], b["moment"])) / (size(b) * length_m) for a, b in pairs]),
            "area": rms(relative("area")), "peak": rms(relative("peak"))}


def _extrapolated(coarse, fine):
    """Richardson: what values on two meshes, (edge, values), tend to; their errors go with the square of the edge."""
    (e1, a), (e2, b) = coarse, fine
    return list(np.asarray(b) + np.subtract(b, a) / ((e1 / e2) ** 2 - 1))


def _extrapolation(edges_mm):
    return "extrapolated from {:g} and {:g} mm".format(*sorted(edges_mm)[1::-1])


def _limit_of(measured):
    """What the forces of the two finest meshes tend to."""
    (e1, a), (e2, b) = measured[-2:]
    extrapolate = lambda k: [_extrapolated((e1, x[k]), (e2, y[k])) for x, y in zip(a["loads"], b["loads"])]
    return [{"force": f, "moment": m, "area": None, "peak": None} for f, m in zip(extrapolate("force"), extrapolate("moment"))]


class Comparison:
    """Of one knee. kept: its cases; limit_s: of processor time, for one case."""

    def __init__(self, file, genu, library, work, data, kept, limit_s):
        self.case, self.kept, self.limit_s = KneeCase(file), kept, limit_s
        self.program, self.library, self.work, self.data = Program(genu, data), str(library), work, data
        self.scene = Scene(self.case, data)
        self.versions, self.loads, self.dates = {}, [], []

    def _note(self, job):
        record = self.kept.last(job)
        self.loads.append(record["load"])
        self.dates.append(record["date"])

    def _peer(self, job, paths, **given):
        """What a task of this package returned. paths: arguments that name files, on which no result depends."""
        arguments = job.options | given
        folder = self.work / job.name

        def measure(limit_s, tick):
            return limited.run(job.task, folder, limit_s, tick, **({} if job.peer() == "Genu" else {"folder": str(folder)}), **paths, **arguments)

        got = self.kept.get(job, self.limit_s, arguments, measure)
        self.versions[job.peer()] = got["version"]
        self._note(job)
        return got

    def _genu(self, job, command, scene_file, **given):
        """A run of the program genu; given: what its scene depends on."""
        names = [n for n, _, _, _ in self.case.compartments]
        output, repeats = self.work / job.name, job.options.get("repeats", 1)

        def measure(limit_s, tick):
            if command == "static":
                return self.program.static(scene_file(), output, job.options["grid"], repeats)
            return self.program.gait(scene_file(), output, job.options["grid"], names, repeats)

        got = self.kept.get(job, self.limit_s, job.options | given, measure)
        self._note(job)
        return got

    def _rows(self, jobs, row):
        """row(job) for every job that makes one; a case without a result makes one that says why."""
        rows = []
        for job in jobs:
            try:
                made = row(job)
            except NotFinished as reason:
                made = Row(job.program, job.setting, note=str(reason))
            except NotMeasured as reason:
                made = Row(job.program, job.setting, note=str(reason))
            if made is not None and job.role != "start":
                rows.append(made)
        order = ("Genu", "Drake", "Drake half space", "OpenSim")
        return sorted(rows, key=lambda r: order.index(r.program))

    def _reference_gait(self):
        job = plan.reference()
        damping = self.case.gait_damping()
        return self._genu(job, "gait", lambda: self.case.write_scene(self.work / "reference.yaml", **damping, gait=job.options["analysis"]), **damping)

    # ---- one evaluation ----

    def _evaluations(self, jobs, given, case, poses, own_limits):
        """Rows with the errors force, moment, area, peak against Genu's converged load or the closed form, and own: of the force against what
        the program itself tends to. own_limits: program -> loads, or None: from its two finest meshes."""
        rows, measured = [], {}
        reference = own_limits["reference"] if own_limits else None

        def row(job):
            nonlocal reference
            if job.program == "Genu":
                got = self._peer(job, {"library": self.library, "case": given}, poses=poses)
                reference = reference or got["rows"][-1]["loads"]
                for r in got["rows"][:-1]:
                    errors = _errors_of_loads(r["loads"], reference, case.length_m)
                    errors["own"] = errors["force"]
                    rows.append(Row("Genu", r["setting"], r["time_s"], errors, fineness=r["size"], size=r["size"], build_s=r["build_s"]))
                return None
            measured.setdefault(job.program, []).append((job, self._peer(job, {"case": given}, poses=poses)))
            return None

        stopped = self._rows(jobs, row)
        if reference is None:
            return []
        for program, of_program in measured.items():
            limit = own_limits[program] if own_limits else _limit_of([(job.edge_mm, r) for job, r in of_program]) if len(of_program) > 1 else None
            for job, r in of_program:
                errors = _errors_of_loads(r["loads"], reference, case.length_m)
                errors["own"] = _errors_of_loads(r["loads"], limit, case.length_m)["force"] if limit else None
                rows.append(Row(program, job.setting, r["time_s"], errors, **_kind(job), size=r["size"], build_s=r["build_s"], memory_MB=r["memory_MB"]))
            rows += [r for r in stopped if r.program == program]
            if limit and not own_limits:
                differ = _errors_of_loads(limit, reference, case.length_m)
                rows.append(Row(program, "limit", None, {k: differ[k] for k in ("force", "moment")}, note=_extrapolation(job.edge_mm for job, _ in of_program)))
        return rows + [r for r in stopped if r.program not in measured]

    def sphere(self):
        case = SphereCase()
        poses = [p.tolist() for p in case.poses()]

        def loads(law):
            F = case.closed_form(law)
            return [{"force": [0, F, 0], "moment": [-p[5] * F, 0, p[3] * F], "area": np.pi * (2 * case.radius_m * case.depth_m - case.depth_m**2),
                     "peak": case.K_Pa * case.depth_m / case.h_m} for p in poses]

        limits = {"reference": loads("midsurface"), "Drake": loads("vertical"), "Drake half space": loads("vertical"), "OpenSim": loads("both meshes")}
        return {"rows": self._evaluations(plan.sphere(), "sphere", case, poses, limits),
                "forces": {p: case.closed_form(law) for p, law in (("Genu", "midsurface"), ("Drake", "vertical"), ("OpenSim", "both meshes"))}}

    def contact(self):
        reference = self._reference_gait()
        k = round(100 * self.scene.time_of_largest_force() / self.scene.cycle_s)
        poses = [reference["poses"][i] for i in [k] + [i for i in range(5, 100, 10) if i != k]]
        return {"rows": self._evaluations(plan.contact(), str(self.case.file), self.case, poses, None)}

    # ---- settle ----

    def settle(self):
        case, t = self.case, self.scene.time_of_largest_force()
        at = {"static": {"time": f"{t:.12g} s"}}
        jobs = plan.settle()
        first, local, uncorrected = (next(j for j in jobs if j.role == role) for role in ("reference", "local", "uncorrected"))
        reference = self._genu(first, "static", lambda: case.write_scene(self.work / "settle.yaml", **at))["pose"]
        moved = self._genu(local, "static", lambda: case.write_scene(self.work / "settle_local.yaml", local_thickness=True, **at))["pose"]
        start = {"rx": 0.0, "y": reference[4] + 1e-3, "z": 0.0}

        def plain(job):
            pose = self._genu(job, "static", lambda: case.write_scene(self.work / "settle_uncorrected.yaml", correction="none", **at))["pose"]
            return Row("Genu", "limit, correction: none", None, self._pose_errors(pose, reference), note="240 x 240")

        uncorrected_rows = self._rows([uncorrected], plain)
        poses = {}  # program -> edge -> pose

        def row(job):
            if job.program == "Genu":
                r = self._genu(job, "static", lambda: case.write_scene(self.work / "settle_from.yaml", start=start, **at), start=start)
                made = Row("Genu", job.setting, r["time_s"], self._pose_errors(r["pose"], reference), **_kind(job), work=f"{r['evaluations']} evaluations")
                made.errors["own"] = made.errors["pose"]
                return made
            r = self._peer(job, self._files(), t=t, start=start)
            poses.setdefault(job.program, {})[job.edge_mm] = r["pose"]
            work = f"{r['steps']} steps" if "steps" in r else f"{r['simulated_s']:.2g} s simulated"
            made = Row(job.program, job.setting, r["time_s"], self._pose_errors(r["pose"], reference), **_kind(job), work=work,
                       residual_N=max(abs(x) for x in r["residual_N"]), memory_MB=r["memory_MB"])
            made.pose = r["pose"]
            return made

        rows = self._rows([j for j in jobs if j.role == "row"], row)
        for program, by_edge in poses.items():
            if len(by_edge) < 2:
                continue
            limit = _extrapolated(*sorted(by_edge.items(), reverse=True)[-2:])
            for r in rows:
                if r.program == program and r.time_s:
                    r.errors["own"] = self._pose_errors(r.pose, limit)["pose"]
            rows.append(Row(program, "limit", None, self._pose_errors(limit, reference), note=_extrapolation(by_edge)))
        return {"rows": rows + uncorrected_rows, "local_mm": self._pose_errors(moved, reference)}

    def _files(self):
        return {"file": str(self.case.file), "data": str(self.data) if self.data else None}

    def _pose_errors(self, pose, reference):
        """Of y, z and rx [mm], angles times length_m; the largest is the pose's."""
        d = np.abs(np.subtract(pose, reference)) * 1e3
        errors = {"y": d[4], "z": d[5], "rx": d[0] * self.case.length_m}
        return dict(errors, pose=max(errors.values()))

    # ---- gait ----

    def gait(self):
        case, reference = self.case, self._reference_gait()
        first = reference["poses"][0]
        above = {"rx": first[0], "y": first[4] + 1e-3, "z": first[5]}
        starts, damping = {}, case.gait_damping()

        def errors(r):
            d = np.abs(np.subtract(r["poses"], reference["poses"]))[:, [4, 5, 0]] * [1e3, 1e3, 1e3 * case.length_m]
            got = dict(zip(("y", "z", "rx"), d.max(axis=0)))
            return dict(got, pose=float(d.max()), force=float(np.abs(np.subtract(r["forces"], reference["forces"])).max()))

        def row(job):
            if job.program == "Genu":
                r = self._genu(job, "gait", lambda: case.write_scene(self.work / "gait.yaml", **damping, gait=job.options["analysis"]), **damping)
                return Row("Genu", job.setting, r["time_s"], errors(r), **_kind(job), steps=r["steps"])
            if job.role == "start":
                starts[job.program, job.edge_mm] = self._peer(job, self._files(), t=0.0, start=above)["pose"]
                return None
            if (job.program, job.edge_mm) not in starts:
                raise NotMeasured("not measured, or no equilibrium to start from")
            pose = starts[job.program, job.edge_mm]
            r = self._peer(job, self._files(), start={"rx": pose[0], "y": pose[4], "z": pose[5]}, rates=reference["rates"], **damping)
            return Row(job.program, job.setting, r["time_s"], errors(r), **_kind(job), steps=r.get("steps"), follow_mm=1e3 * r["follow_m"], memory_MB=r["memory_MB"])

        return {"rows": self._rows(plan.gait(), row)}
