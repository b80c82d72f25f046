"""Tables 3 and 4, Fig. 5 and the times: both applications on the shipped and the measured knees."""

import csv
import math
import sys

from . import markdown, plots
from .published import TABLE3, TABLE4, TIMES
from .results import QUANTITIES, at_pose, by_side, read_summary, read_table


def write_loads(title, columns):
    """columns: [(heading, [(medial, lateral)] per quantity)]"""
    rows = []
    for i, (name, unit, _, _, form) in enumerate(QUANTITIES):
        rows.append([f"{name} [{unit}]"] + [markdown.pair(form, values[i]) for _, values in columns])
    rows.append(["medial share of force [%]"] + ["%.1f" % (100 * v[0][0] / sum(v[0])) for _, v in columns])
    return markdown.table([title] + [heading for heading, _ in columns], rows)


class Applications:
    def __init__(self, run, real):
        self.run, self.real = run, real
        self.times = []

    def natural(self):
        """Table 3."""
        texts = []
        peaks = {}
        for strain, scene in (("large", "static_large_strain.yaml"), ("small", "static.yaml")):
            columns = [("Paper", TABLE3[strain])]
            for model in ("natural_knee", "natural_knee_mri") if self.real else ("natural_knee",):
                folder = self.run.scene("static", f"{model}/{scene}", f"{model}_{strain}")
                columns.append((model, by_side(at_pose(read_summary(folder))["contact"])))
                self.times.append(("static", f"static analysis, {model}, {strain} strain", folder))
            for heading, values in columns:
                peaks.setdefault(heading, []).append(values)
            texts.append(write_loads(f"{strain.capitalize()} strain, medial / lateral", columns))
        more = []
        for heading, (large, small) in peaks.items():
            change = [[100 * (large[i][s] / small[i][s] - 1) for s in (0, 1)] for i in range(len(QUANTITIES))]
            more.append([heading] + [markdown.pair("%+.1f", change[i]) for i in range(len(QUANTITIES))])
        texts.append(markdown.table(["Large over small strain [%]"] + [name for name, *_ in QUANTITIES], more))
        return "\n\n".join(texts)

    def artificial(self):
        """Table 4. Leaves the folders of the runs in self.gaits by model and law."""
        texts = []
        self.gaits = {}
        for law, scene in (("linear", "gait.yaml"), ("power law", "gait_power_law.yaml")):
            columns = [("Paper, 50 x 50", TABLE4[law])]
            for model in ("artificial_knee", "tka_dm") if self.real else ("artificial_knee",):
                name = f"{model}_{law.replace(' ', '_')}"
                folder = self.run.scene("gait", f"{model}/{scene}", name)
                replayed = self.run.analyse("replay", folder, name + "_50x50", "--grid", "50x50")
                for grid, result in (("30 x 30", folder), ("50 x 50", replayed)):
                    columns.append((f"{model}, {grid}", by_side(at_pose(read_summary(result))["contact"])))
                self.times += [("gait", f"gait cycle, {model}, {law}", folder), ("replay", f"the same on 50 x 50, {model}, {law}", replayed)]
                self.gaits[model, law] = folder
            texts.append(write_loads(f"{law.capitalize()}, medial / lateral", columns))
        return "\n\n".join(texts)

    def motion(self, measured_file, picture):
        """Fig. 5: what tka_dm predicts beside the fluoroscopy of its owner."""
        with open(measured_file, newline="") as stream:
            measured = [{k: float(v) for k, v in row.items()} for row in csv.DictReader(stream)]
        rows, panels = [], []
        laws = ("linear", "power law")
        motions = {law: read_table(self.gaits["tka_dm", law] / "motion.sto") for law in laws}
        for label, unit, name, column, to_out, to_measured in (
                ("superior-inferior y", "mm", "y", "ty_m", 1e3, 1e3), ("medial-lateral z", "mm", "z", "tz_m", 1e3, 1e3),
                ("varus-valgus rx", "deg", "rx", "rx_rad", 1, 180 / math.pi)):
            truth = [to_measured * row[column] for row in measured]
            for law in laws:
                predicted = [to_out * v for v in motions[law][name]]
                if len(predicted) != len(truth):
                    sys.exit(f"compare_with_paper: {len(predicted)} output times, but {measured_file} has {len(truth)} rows")
                for sign in ((1,) if name == "y" else (1, -1)):
                    difference = [p - sign * t for p, t in zip(predicted, truth)]
                    mean = sum(difference) / len(difference)
                    rms = math.sqrt(sum(d * d for d in difference) / len(difference))
                    sd = math.sqrt(max(0.0, rms * rms - mean * mean))
                    rows.append([law, f"{label} [{unit}]" + (", measured mirrored" if sign < 0 else ""), "%.2f" % mean, "%.2f" % rms, "%.2f" % sd,
                                 "%.2f .. %.2f" % (min(predicted), max(predicted)), "%.2f .. %.2f" % (min(sign * t for t in truth), max(sign * t for t in truth))])
            curves = []
            if unit == "mm":
                curves.append(plots.Curve([(i, t - 1, t + 1) for i, t in enumerate(truth)], "with filledcurves fs solid noborder lc rgb '#d9d9d9'", using="1:2:3"))
            curves.append(plots.Curve(list(enumerate(truth)), "with lines lw 2.5 lc rgb '#777777'"))
            if name != "y":
                curves.append(plots.Curve([(i, -t) for i, t in enumerate(truth)], "with lines lw 2 dt 3 lc rgb '#777777'"))
            for law, style in zip(laws, (f"lw 2.5 lc rgb '{plots.COLORS[0]}'", f"lw 2.5 dt 2 lc rgb '{plots.COLORS[1]}'")):
                curves.append(plots.Curve([(i, to_out * v) for i, v in enumerate(motions[law][name])], "with lines " + style))
            last = name == "rx"
            panels.append([plots.Panel(curves, xlabel="per cent of the gait cycle" if last else "", ylabel=f"{name} ({unit})", title=label,
                                       settings="set xrange [0:100]")])
        rows.sort(key=lambda row: laws.index(row[0]))
        plots.draw(picture, panels, [("measured", "with lines lw 2.5 lc rgb '#777777'"), ("+- 1 mm", "with filledcurves fs solid noborder lc rgb '#d9d9d9'"),
                                     ("mirrored", "with lines lw 2 dt 3 lc rgb '#777777'"), ("linear", f"with lines lw 2.5 lc rgb '{plots.COLORS[0]}'"),
                                     ("power law", f"with lines lw 2.5 dt 2 lc rgb '{plots.COLORS[1]}'")], panel_size=(820, 230))
        return markdown.table(["Law", "Predicted minus measured", "Mean", "rms", "sd", "Predicted", "Measured"], rows)

    def write_times(self):
        rows = []
        for kind, label, folder in self.times:
            summary = read_summary(folder)
            rows.append([label, TIMES[kind], "%.2f" % summary["cpu_time_s"], "%.0f" % summary["peak_memory_MB"]])
        return markdown.table(["CPU time [s]", "Paper", "Here", "Memory [MB]"], rows)
