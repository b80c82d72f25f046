"""The three comparisons as tables: rows of program, setting, time and errors, and the cheapest setting within an error beside Genu's."""
import numpy as np

from . import limited
from .case import KneeCase, SphereCase
from .limited import NotFinished
from .motion import Scene
from .own_runs import Program

LIMIT_S = 200  # of processor time, for one run of a peer

EDGES_M = (4e-3, 2.8e-3, 2e-3, 1.4e-3, 1e-3, 0.7e-3, 0.5e-3, 0.35e-3)
GRIDS = (4, 6, 8, 12, 16, 20, 30, 45, 60, 90, 120)


class Row:
    """errors: name -> value, None where the program does not give it. note: why a run has no result."""

    def __init__(self, program, setting, time_s=None, errors=None, note="", **more):
        self.program, self.setting, self.time_s, self.errors, self.note, self.more = program, setting, time_s, errors or {}, note, more

    def to_json(self):
        plain = lambda v: v if v is None or isinstance(v, (str, int)) else float(v)
        return {"program": self.program, "setting": self.setting, "time_s": plain(self.time_s), "errors": {k: plain(v) for k, v in self.errors.items()},
                "note": self.note, "more": {k: plain(v) for k, v in self.more.items()}}

    @staticmethod
    def from_json(given):
        return Row(given["program"], given["setting"], given["time_s"], given["errors"], given["note"], **given["more"])


def number(value, digits=2):
    return "–" if value is None else f"{value:.{digits}g}" if 1e-3 <= abs(value) < 10**digits else f"{value:.0f}" if abs(value) >= 10**digits else f"{value:.1e}"


def table(header, rows):
    return ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)] + ["| " + " | ".join(str(c) for c in r) + " |" for r in rows] + [""]


def cheapest(rows, program, error, level):
    within = [r for r in rows if r.program == program and r.time_s is not None and r.errors.get(error) is not None and r.errors[error] <= level]
    return min(within, key=lambda r: r.time_s, default=None)


def equal_error(rows, error, levels, unit, scale):
    """scale: of times, to ms. A line for each level: the cheapest setting of each program that is within it, and how often Genu's time."""
    programs = list(dict.fromkeys(r.program for r in rows))
    programs.remove("Genu")
    header = [f"Error at most [{unit}]", "Genu [ms]"] + [x for p in programs for x in (f"{p} [ms]", f"{p} / Genu")]
    lines = []
    for level in levels:
        own = cheapest(rows, "Genu", error, level)
        line = [f"{level:g}", "none measured" if own is None else f"{number(scale * own.time_s, 3)} ({own.setting})"]
        for p in programs:
            peer = cheapest(rows, p, error, level)
            if peer is None:
                line += ["none measured", "–"]
            else:
                line += [f"{number(scale * peer.time_s, 3)} ({peer.setting})", "–" if own is None else f"**{number(peer.time_s / own.time_s)}**"]
        lines.append(line)
    return table(header, lines)


def _errors_of_loads(loads, references, length_m):
    """Root mean squares over the poses [%]: force; moment about the fixed origin over force times length_m; area; peak pressure."""
    rms = lambda values: None if any(v is None for v in values) else 100 * float(np.sqrt(np.mean(np.square(values))))
    pairs = list(zip(loads, references))
    size = lambda r: np.linalg.norm(r["force"])
    relative = lambda k: [None if a[k] is None or b[k] is None else a[k] / b[k] - 1 for a, b in pairs]
    return {"force": rms([np.linalg.norm(np.subtract(a["force"], b["force"])) / size(b) for a, b in pairs]),
            "moment": rms([np.linalg.norm(np.subtract(a["moment"], b["moment"])) / (size(b) * length_m) for a, b in pairs]),
            "area": rms(relative("area")), "peak": rms(relative("peak"))}


def _limit_of(measured):
    """Richardson: what the forces of the two finest meshes, whose errors go with the square of the edge, tend to."""
    (e1, a), (e2, b) = measured[-2:]
    share = 1 / ((e1 / e2) ** 2 - 1)
    extrapolate = lambda k: [list(np.asarray(y[k]) + share * np.subtract(y[k], x[k])) for x, y in zip(a["loads"], b["loads"])]
    return [{"force": f, "moment": m, "area": None, "peak": None} for f, m in zip(extrapolate("force"), extrapolate("moment"))]


class Comparison:
    """peers: those that run; a table says which did not."""

    def __init__(self, genu, library, work, data, peers=("Drake", "OpenSim")):
        self.peers = peers
        self.program, self.library, self.work, self.data = Program(genu, data), str(library), work, data
        self.versions = {}

    def _job(self, task, name, limit_s=LIMIT_S, **arguments):
        folder = self.work / name
        got = limited.run(task, folder, limit_s, folder=str(folder), **arguments)
        self.versions[task.split(":")[1].split("_")[0]] = got.pop("version")
        return got

    # ---- one evaluation ----

    def _evaluations(self, given, case, poses, own_limits, edges, halves=()):
        """Rows with the errors force, moment, area, peak against Genu's converged load or the closed form, and own: of the force against what
        the program itself tends to. own_limits: program -> loads, or None: from its two finest meshes."""
        got = limited.run("measure:genu", self.work / "genu", 10 * LIMIT_S, case=given, library=self.library, grids=list(GRIDS) + [240], poses=poses)
        self.versions["genu"] = got["version"]
        reference = own_limits["reference"] if own_limits else got["rows"][-1]["loads"]
        rows = []
        for r in got["rows"][:-1]:
            errors = _errors_of_loads(r["loads"], reference, case.length_m)
            errors["own"] = errors["force"]
            rows.append(Row("Genu", r["setting"], r["time_s"], errors, size=r["size"], build_s=r["build_s"]))
        runs = [("Drake", "measure:drake", {})] + list(halves) + [("OpenSim", "measure:opensim", {})]
        for program, task, options in runs:
            if program.split()[0] not in self.peers:
                continue
            measured = []
            for edge in edges:
                try:
                    measured.append((edge, self._job(task, f"{program}_{1e3 * edge:g}".replace(" ", "_"), case=given, edge_m=edge, poses=poses, **options)))
                except NotFinished as reason:
                    rows.append(Row(program, f"{1e3 * edge:g} mm", note=str(reason)))
            limit = own_limits[program] if own_limits else _limit_of(measured)
            for edge, r in measured:
                errors = _errors_of_loads(r["loads"], reference, case.length_m)
                errors["own"] = _errors_of_loads(r["loads"], limit, case.length_m)["force"]
                rows.append(Row(program, f"{1e3 * edge:g} mm", r["time_s"], errors, size=r["size"], build_s=r["build_s"]))
            if not own_limits:
                differ = _errors_of_loads(limit, reference, case.length_m)
                rows.append(Row(program, "limit", None, {k: differ[k] for k in ("force", "moment")}, note="extrapolated"))
        return rows

    def sphere(self):
        case = SphereCase()
        poses = [p.tolist() for p in case.poses()]

        def loads(law):
            F = case.closed_form(law)
            return [{"force": [0, F, 0], "moment": [-p[5] * F, 0, p[3] * F], "area": np.pi * (2 * case.radius_m * case.depth_m - case.depth_m**2),
                     "peak": case.K_Pa * case.depth_m / case.h_m} for p in poses]

        limits = {"reference": loads("midsurface"), "Drake": loads("vertical"), "Drake half space": loads("vertical"), "OpenSim": loads("both meshes")}
        rows = self._evaluations("sphere", case, poses, limits, EDGES_M, [("Drake half space", "measure:drake", {"half_space": True})])
        forces = {p: case.closed_form(law) for p, law in (("Genu", "midsurface"), ("Drake", "vertical"), ("OpenSim", "both meshes"))}
        return rows, forces

    def contact(self, file):
        case = KneeCase(file)
        reference = self._gait_reference(case)
        scene = Scene(case, self.data)
        k = round(100 * scene.time_of_largest_force() / scene.cycle_s)
        poses = [reference["poses"][i] for i in [k] + [i for i in range(5, 100, 10) if i != k]]
        edges = EDGES_M[1:]
        return self._evaluations(str(file), case, poses, None, edges)

    # ---- settle ----

    def _scene(self, case, name, start=None, **analysis):
        return case.write_scene(self.work / f"{case.name}_{name}.yaml", start=start, **analysis)

    def settle(self, file):
        case = KneeCase(file)
        scene = Scene(case, self.data)
        t = scene.time_of_largest_force()
        plain = self._scene(case, "settle", static={"time": f"{t:.12g} s"})
        reference = self.program.static(plain, self.work / "settle_reference", 240)["pose"]
        local = case.write_scene(self.work / f"{case.name}_local.yaml", local_thickness=True, static={"time": f"{t:.12g} s"})
        self.local_mm = self._pose_errors(self.program.static(local, self.work / "settle_local", 240)["pose"], reference, case)
        start = {"rx": 0.0, "y": reference[4] + 1e-3, "z": 0.0}
        from_start = self._scene(case, "settle_from", start=start, static={"time": f"{t:.12g} s"})
        rows = []
        for grid in (4, 6, 8, 12, 16, 30, 60):
            try:
                r = self.program.static(from_start, self.work / "settle", grid, repeats=10)
                rows.append(Row("Genu", f"{grid} x {grid}", r["time_s"], self._pose_errors(r["pose"], reference, case), steps=f"{r['evaluations']} evaluations"))
            except NotFinished as reason:
                rows.append(Row("Genu", f"{grid} x {grid}", note=str(reason)))
        for edge in EDGES_M[1:-1]:
            for step in (0.001, 0.002):
                self._settle_row(rows, "Drake", f"{1e3 * edge:g} mm, {1e3 * step:g} ms", "motion:drake_settle", reference, case, edge_m=edge, step_s=step,
                                 file=str(file), t=t, start=start)
        for edge in EDGES_M[1:4]:
            self._settle_row(rows, "OpenSim", f"{1e3 * edge:g} mm, 1e-4", "motion:opensim_settle", reference, case, edge_m=edge, accuracy=1e-4,
                             file=str(file), t=t, start=start)
        return rows

    def _settle_row(self, rows, program, setting, task, reference, case, **arguments):
        if program not in self.peers:
            return
        try:
            r = self._job(task, f"settle_{program}", data=str(self.data) if self.data else None, **arguments)
            steps = f"{r['steps']} steps" if "steps" in r else f"{r['simulated_s']:.2g} s simulated"
            rows.append(Row(program, setting, r["time_s"], self._pose_errors(r["pose"], reference, case), steps=steps,
                            residual_N=max(abs(x) for x in r["residual_N"])))
        except NotFinished as reason:
            rows.append(Row(program, setting, note=str(reason)))

    @staticmethod
    def _pose_errors(pose, reference, case):
        """Of y, z and rx [mm], angles times length_m; the largest is the pose's."""
        d = np.abs(np.subtract(pose, reference)) * 1e3
        errors = {"y": d[4], "z": d[5], "rx": d[0] * case.length_m}
        return dict(errors, pose=max(errors.values()))

    # ---- gait ----

    def _gait_reference(self, case):
        scene = self._scene(case, "reference", gait={"accuracy": 1e-6})
        return self.program.gait(scene, self.work / "gait_reference", 120, [n for n, _, _, _ in case.compartments])

    def gait(self, file):
        case = KneeCase(file)
        names = [n for n, _, _, _ in case.compartments]
        reference = self._gait_reference(case)
        rows = []

        def errors(poses, forces):
            d = np.abs(np.subtract(poses, reference["poses"]))[:, [4, 5, 0]] * [1e3, 1e3, 1e3 * case.length_m]
            got = dict(zip(("y", "z", "rx"), d.max(axis=0)))
            return dict(got, pose=float(d.max()), force=float(np.abs(np.subtract(forces, reference["forces"])).max()))

        settings = [("cpodes", {"accuracy": 1e-4}, g) for g in (8, 12, 16, 30)] + [("cpodes", {"accuracy": 1e-5}, 30), ("cpodes", {"accuracy": 1e-3}, 12)]
        settings += [("generalized-alpha", {"step": f"{s} ms"}, g) for s in (1, 2, 5) for g in (8, 15)]
        for integrator, options, grid in settings:
            setting = f"{integrator} {next(iter(options.values()))}, {grid} x {grid}"
            try:
                scene = self._scene(case, "gait", gait=dict(options, integrator=integrator))
                r = self.program.gait(scene, self.work / "gait", grid, names, repeats=3)
                rows.append(Row("Genu", setting, r["time_s"], errors(r["poses"], r["forces"]), steps=r["steps"]))
            except NotFinished as reason:
                rows.append(Row("Genu", setting, note=str(reason)))
        first = reference["poses"][0]
        above = {"rx": first[0], "y": first[4] + 1e-3, "z": first[5]}
        common = {"file": str(file), "data": str(self.data) if self.data else None, "rates": reference["rates"]}
        steps = {2.8e-3: (0.005,), 2e-3: (0.01, 0.005, 0.002), 1.4e-3: (0.005, 0.002), 1e-3: (0.005, 0.002, 0.001), 0.7e-3: (0.002,)}
        drake = {edge: [{"step_s": s} for s in of_edge] for edge, of_edge in steps.items()}
        drake[2e-3] += [{"scheme": "cenic", "accuracy": 1e-3, "longest_step_s": 0.001}]
        drake[2.8e-3] += [{"scheme": "implicit_euler", "accuracy": 1e-3, "longest_step_s": 0.01, "limit_s": 20}]
        for edge, settings in drake.items():
            self._gait_rows(rows, "Drake", "motion:drake_gait", edge, settings, errors, above, {"step_s": 0.001}, common)
        merson = {"accuracy": 1e-3}
        for edge, settings in ((4e-3, [merson, {"accuracy": 1e-4, "method": "CPodes", "limit_s": 20}]), (2.8e-3, [merson]), (2e-3, [merson])):
            self._gait_rows(rows, "OpenSim", "motion:opensim_gait", edge, settings, errors, above, {"accuracy": 1e-4}, common)
        return rows

    def _gait_rows(self, rows, program, task, edge, settings, errors, above, settle, common):
        """Each starts from the program's own equilibrium on the same mesh: the start makes no vibration."""
        if program not in self.peers:
            return
        try:
            rest = self._job(task.replace("gait", "settle"), f"gait_{program}", file=common["file"], data=common["data"], edge_m=edge, t=0.0, start=above,
                             **settle)
        except NotFinished as reason:
            rows.append(Row(program, f"{1e3 * edge:g} mm", note=f"start: {reason}"))
            return
        start = {"rx": rest["pose"][0], "y": rest["pose"][4], "z": rest["pose"][5]}
        for options in settings:
            if options.get("step_s"):
                text = f"{1e3 * options['step_s']:g} ms"
            else:
                text = f"{options.get('scheme') or options.get('method', 'RKM')} {options['accuracy']:g}"
            setting = f"{1e3 * edge:g} mm, {text}"
            try:
                r = self._job(task, f"gait_{program}", edge_m=edge, start=start, **common, **options)
                rows.append(Row(program, setting, r["time_s"], errors(r["poses"], r["forces"]), steps=r.get("steps"), follow_mm=1e3 * r["follow_m"]))
            except NotFinished as reason:
                rows.append(Row(program, setting, note=str(reason)))
            print(f"  {program}, {setting}: {number(rows[-1].time_s)} s, {number(rows[-1].errors.get('pose'))} mm {rows[-1].note}", flush=True)
