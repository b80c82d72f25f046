"""Tables 3 and 4, Fig. 5 and the times: both applications on the shipped and the measured knees."""

import csv
import math
import sys

from . import markdown, plots
from .published import TABLE3, TABLE4, TIMES
from .results import QUANTITIES, at_pose, by_side, read_scene, read_summary, read_table, with_rule, write_scene

FORCE, PEAK, MEAN, AREA = 0, 2, 3, 4  # of QUANTITIES
# K = (1 - nu) E / ((1 + nu) (1 - 2 nu)) of Application 1 [MPa]
MODULUS_MPA = 0.55 * 4 / (1.45 * 0.1)
# After this share of the cycle the loads are small and the implant's medial-lateral motion is not determined.
DETERMINED_S = 0.70
LAWS = ("linear", "power law")


def write_loads(title, columns):
    """columns: [(heading, [(medial, lateral)] per quantity)]; the first are the paper's, in its digits."""
    rows = []
    for i, (name, unit, _, _, form) in enumerate(QUANTITIES):
        rows.append([f"{name} [{unit}]"] + [markdown.pair("%.4g" if c == 0 else form, values[i]) for c, (_, values) in enumerate(columns)])
    rows.append(["peak over average"] + [markdown.pair("%.2f", [v[PEAK][s] / v[MEAN][s] for s in (0, 1)]) for _, v in columns])
    rows.append(["medial share of force [%]"] + ["%.1f" % (100 * v[FORCE][0] / sum(v[FORCE])) for _, v in columns])
    return markdown.table([title] + [heading for heading, _ in columns], rows)


def signed(number, places):
    """Without a minus before zeros."""
    return f"{round(number, places) + 0.0:+.{places}f}"


def write_changes(title, rows):
    """rows: [(heading, from, to)]; changes in per cent."""
    lines = []
    for heading, before, after in rows:
        changes = [[signed(100 * (a / b - 1), 1) for a, b in zip(*pairs)] for pairs in zip(after, before)]
        lines.append([heading] + [" / ".join(change) for change in changes])
    return markdown.table([title] + [name for name, *_ in QUANTITIES], lines)


def solve_large_strain(strain):
    """A paraboloid presses a layer to this d/h under small strain; d/h under large strain with the same force:
    (1 - s) ln(1 - s) + s = strain^2 / 2."""
    low, high = 0.0, strain
    for _ in range(60):
        s = 0.5 * (low + high)
        low, high = (s, high) if (1 - s) * math.log(1 - s) + s < 0.5 * strain * strain else (low, s)
    return low


def paraboloid_changes(peaks_MPa):
    """What going to large strain does to a paraboloid of these small-strain peaks, in per cent: peak, average, area."""
    changes = []
    for peak in peaks_MPa:
        small = peak / MODULUS_MPA
        large = solve_large_strain(small)
        changes.append((-math.log(1 - large) / small, small / large, large / small))
    return [markdown.pair("%+.1f", [100 * (c[i] - 1) for c in changes]) for i in range(3)]


class Applications:
    def __init__(self, run, real):
        self.run, self.real = run, real
        self.times = []

    def natural(self):
        """Table 3."""
        texts, found = [], {}
        for strain, scene in (("large", "static_large_strain.yaml"), ("small", "static.yaml")):
            columns = [("Paper", TABLE3[strain])]
            for model in ("natural_knee", "natural_knee_mri") if self.real else ("natural_knee",):
                folder = self.run.analyse("static", self.run.shipped(f"{model}/{scene}"), f"{model}_{strain}")
                columns.append((model, by_side(at_pose(read_summary(folder))["contact"])))
                centre = write_scene(self.run.output / "scenes", f"{model}_{strain}_centre", with_rule(read_scene(f"{model}/{scene}"), "centre"))
                counted = self.run.analyse("static", centre, f"{model}_{strain}_centre")
                found.setdefault(model + ", centre rule", []).append(by_side(at_pose(read_summary(counted))["contact"]))
                self.times.append(("static", f"static analysis, {model}, {strain} strain", folder))
            for heading, values in columns:
                found.setdefault(heading, []).append(values)
            texts.append(write_loads(f"{strain.capitalize()} strain, medial / lateral", columns))
        changes = write_changes("Large over small strain [%]", [(heading, small, large) for heading, (large, small) in found.items()])
        for heading, (_, small) in found.items():
            if "centre" in heading:
                continue
            label = "paraboloid with the small-strain peaks of " + heading.replace("Paper", "the paper")
            changes += "\n| " + " | ".join([label, "0", "-", *paraboloid_changes(small[PEAK])]) + " |"
        return "\n\n".join(texts + [changes])

    def artificial(self):
        """Table 4. Leaves the folders of the runs in self.gaits by model and law."""
        texts, changes = [], []
        self.gaits = {}
        models = ("artificial_knee", "tka_dm") if self.real else ("artificial_knee",)
        for law, scene in zip(LAWS, ("gait.yaml", "gait_power_law.yaml")):
            columns = [("Paper, 50 x 50", TABLE4[law])]
            for model in models:
                name = f"{model}_{law.replace(' ', '_')}"
                folder, results = self.walk(self.run.shipped(f"{model}/{scene}"), name)
                columns += [(f"{model}, {grid}", values) for grid, values in zip(("30 x 30", "50 x 50"), results)]
                self.times += [("gait", f"gait cycle, {model}, {law}", folder),
                               ("replay", f"the same on 50 x 50, {model}, {law}", folder.parent / (name + "_50x50"))]
                changes.append((f"{model}, {law}", *results))
                self.gaits[model, law] = folder
            texts.append(write_loads(f"{law.capitalize()}, medial / lateral", columns))
        for model in models:
            scene = write_scene(self.run.output / "scenes", f"{model}_gait_centre", with_rule(read_scene(f"{model}/gait.yaml"), "centre"))
            changes.append((f"{model}, linear, centre rule", *self.walk(scene, f"{model}_linear_centre")[1]))
        texts.append(write_changes("From 30 x 30 to 50 x 50, same motion [%]", changes))
        return "\n\n".join(texts)

    def walk(self, scene, name):
        """Gait, and its replay on 50 x 50: the folder of the first, the loads of both."""
        folder = self.run.analyse("gait", scene, name)
        replayed = self.run.analyse("replay", folder, name + "_50x50", "--grid", "50x50")
        return folder, [by_side(at_pose(read_summary(f))["contact"]) for f in (folder, replayed)]

    def motion(self, measured_file, picture):
        """Fig. 5: what tka_dm predicts beside the fluoroscopy of its owner, and how well the prediction is determined."""
        with open(measured_file, newline="") as stream:
            measured = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(stream)]
        text = read_scene("tka_dm/gait.yaml").replace("gait: {", "gait: {accuracy: 1e-6, ")
        tight = write_scene(self.run.output / "scenes", "tka_dm_tight", text)
        motions = {law: read_table(self.gaits["tka_dm", law] / "motion.sto") for law in LAWS}
        motions["linear, 1e-6"] = read_table(self.run.analyse("gait", tight, "tka_dm_linear_tight") / "motion.sto")
        times = motions["linear"]["time"]
        if len(times) != len(measured):
            sys.exit(f"compare_with_paper: {len(times)} output times, but {measured_file} has {len(measured)} rows")
        determined = [i for i, t in enumerate(times) if t < DETERMINED_S + 1e-9]
        grey, band = "with lines lw 2.5 lc rgb '#777777'", "with filledcurves fs solid noborder lc rgb '#d9d9d9'"
        mirrored = "with lines lw 2 dt 3 lc rgb '#777777'"
        styles = {"linear, 1e-6": f"with lines lw 2 lc rgb '{plots.COLORS[3]}'", "linear": f"with lines lw 2.5 lc rgb '{plots.COLORS[0]}'",
                  "power law": f"with lines lw 2.5 dt 2 lc rgb '{plots.COLORS[1]}'"}
        rows, panels = [], []
        for label, unit, name, column, to_out, to_measured in (
                ("superior-inferior y", "mm", "y", "ty_m", 1e3, 1e3), ("medial-lateral z", "mm", "z", "tz_m", 1e3, 1e3),
                ("varus-valgus rx", "deg", "rx", "rx_rad", 1, 180 / math.pi)):
            truth = [to_measured * row[column] for row in measured]
            curves = {key: [to_out * v for v in motion[name]] for key, motion in motions.items()}

            def compare(heading, first, second):
                row = [f"{label} [{unit}]", heading]
                for places in (determined, range(len(times))):
                    difference = [first[i] - second[i] for i in places]
                    mean = sum(difference) / len(difference)
                    rms = math.sqrt(sum(d * d for d in difference) / len(difference))
                    row += [signed(mean, 2), "%.2f" % rms, "%.2f" % max(map(abs, difference))]
                rows.append(row)

            for law in LAWS:
                compare(f"{law} minus measured", curves[law], truth)
            if name != "y":
                compare("linear minus measured, mirrored", curves["linear"], [-t for t in truth])
            compare("power law minus linear", curves["power law"], curves["linear"])
            compare("linear minus linear, accuracy 1e-6", curves["linear"], curves["linear, 1e-6"])
            drawn = [plots.Curve([(i, t - 1, t + 1) for i, t in enumerate(truth)], band, "1:2:3")] if unit == "mm" else []
            drawn.append(plots.Curve(list(enumerate(truth)), grey))
            if name != "y":
                drawn.append(plots.Curve([(i, -t) for i, t in enumerate(truth)], mirrored))
            drawn += [plots.Curve(list(enumerate(curves[key])), style) for key, style in styles.items()]
            xlabel = "per cent of the gait cycle" if name == "rx" else ""
            panels.append([plots.Panel(drawn, title=label, xlabel=xlabel, ylabel=f"{name} ({unit})", settings="set xrange [0:100]")])
        key = [("measured", grey), ("\u00b11 mm", band), ("mirrored", mirrored), ("linear", styles["linear"]),
               ("accuracy 1e-6", styles["linear, 1e-6"]), ("power law", styles["power law"])]
        plots.draw(picture, panels, key, panel_size=(920, 220), gap_y=44)
        share = f"0 to {100 * DETERMINED_S:.0f} %"
        return markdown.table(["", "Difference", f"{share}: mean", "rms", "largest", "whole cycle: mean", "rms", "largest"], rows)

    def write_times(self):
        rows = []
        for kind, label, folder in self.times:
            summary = read_summary(folder)
            rows.append([label, TIMES[kind], "%.2f" % summary["cpu_time_s"], "%.0f" % summary["peak_memory_MB"]])
        return markdown.table(["CPU time [s]", "Paper", "Here", "Memory [MB]"], rows)
