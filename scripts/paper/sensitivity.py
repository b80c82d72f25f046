"""Fig. 6: contact in one pose against the number of elements along x and along z, with the paper's rule (whole elements) and
with the smooth one, and the estimates of the error."""

from . import markdown, plots
from .results import QUANTITIES, SIDES, at_pose, errors, read_scene, read_summary, sides, values, write_scene

DIVISIONS = (5, 6, 8, 10, 12, 14, 16, 18, 20, 22, 25, 28, 30, 35, 40, 45, 50, 60, 70, 80, 90, 100)
SQUARES = (10, 20, 30, 50, 100)
OTHER = 50  # elements along the other direction: the grid of the paper's pressures
FINEST = 400
RULES = ("centre", "smooth")


def pose_text(pose):
    return ", ".join(f"{pose[name + '_' + unit]!r} {unit}" for name, unit in (("rx", "deg"), ("ry", "deg"), ("rz", "deg"), ("x", "mm"), ("y", "mm"), ("z", "mm")))


class Sensitivity:
    def __init__(self, run, model, gait):
        """gait: folder of the linear run, whose pose at maximum load is used."""
        text = read_scene(f"{model}/gait.yaml")
        head, tail = text.split("    material: polyethylene\n", 1)
        self.run, self.model = run, model
        self.scenes = {rule: write_scene(run.output / "scenes", f"{model}_{rule}", head + f"    material: polyethylene\n    rule: {rule}\n" + tail) for rule in RULES}
        self.pose = pose_text(at_pose(read_summary(gait))["pose"])
        self.reference = self.evaluate("smooth", FINEST, FINEST)[0]

    def evaluate(self, rule, nx, nz):
        """Values and estimated errors: [side][quantity]."""
        contact = self.run.contact(self.scenes[rule], self.pose, f"{nx}x{nz}")
        return [values(load) for load in sides(contact)], [errors(load) for load in sides(contact)]

    def percent(self, numbers):
        return [[100 * (n / r - 1) for n, r in zip(*pair)] for pair in zip(numbers, self.reference)]

    def draw(self, picture):
        """Difference from the finest grid against divisions; and the largest ones from 30 divisions on, as rows of a table."""
        directions = ("x", "z")
        results = {(d, rule): [(n, self.percent(self.evaluate(rule, *((n, OTHER) if d == "x" else (OTHER, n)))[0])) for n in DIVISIONS]
                   for d in directions for rule in RULES}
        styles = {("centre", 0): f"with linespoints lw 1.8 pt 7 ps 0.8 lc rgb '{plots.COLORS[0]}'", ("centre", 1): f"with linespoints lw 1.8 pt 5 ps 0.8 lc rgb '{plots.COLORS[1]}'",
                  ("smooth", 0): f"with lines lw 2.5 dt 2 lc rgb '{plots.COLORS[2]}'", ("smooth", 1): f"with lines lw 2.5 dt 3 lc rgb '{plots.COLORS[3]}'"}
        panels = []
        for q, (name, _, _, _, _) in enumerate(QUANTITIES):
            row = []
            # Both directions of a quantity have one scale, so that they can be compared.
            spread = [p[side][q] for result in results.values() for _, p in result for side in (0, 1)]
            low, high = min(spread), max(spread)
            margin = 0.06 * (high - low)
            for d in directions:
                curves = [plots.Curve([(n, p[side][q]) for n, p in results[d, rule]], styles[rule, side]) for rule in RULES for side in (0, 1)]
                row.append(plots.Panel(curves, title=name, ylabel="difference (%)", xlabel=f"elements along {d}, {OTHER} along {'z' if d == 'x' else 'x'}",
                                       settings=f"set xrange [0:102]; set yrange [{low - margin:.6g}:{high + margin:.6g}]; set xzeroaxis lc rgb '#404040' lt 1 lw 1"))
            panels.append(row)
        plots.draw(picture, panels, [(f"{rule} rule, {side}", styles[rule, i]) for rule in RULES for i, side in enumerate(SIDES)], panel_size=(560, 200))
        rows = []
        for q, (name, _, _, _, _) in enumerate(QUANTITIES):
            row = [self.model, name]
            for rule in RULES:
                for d in directions:
                    row.append(" / ".join("%.2g" % max(abs(p[side][q]) for n, p in results[d, rule] if n >= least for side in (0, 1)) for least in (10, 30)))
            rows.append(row)
        return rows

    def estimates(self, picture):
        """True and estimated errors on n x n elements; rows of a table."""
        results = {rule: [(n, *self.evaluate(rule, n, n)) for n in SQUARES] for rule in RULES}
        rows = []
        for n_index, n in enumerate(SQUARES):
            for rule in RULES:
                _, numbers, estimated = results[rule][n_index]
                row = [self.model, f"{n} x {n}", rule]
                for q in range(len(QUANTITIES)):
                    side = max((0, 1), key=lambda s: abs(numbers[s][q] / self.reference[s][q] - 1))
                    row.append(" / ".join("%.1g" % (100 * e / self.reference[side][q]) for e in (abs(numbers[side][q] - self.reference[side][q]), estimated[side][q])))
                rows.append(row)
        return rows


def write(sensitivities, images):
    """{section: text}; pictures paper_sensitivity_MODEL.png."""
    spread, estimated = [], []
    for s in sensitivities:
        spread += s.draw(images / f"paper_sensitivity_{s.model}.png")
        estimated += s.estimates(None)
    names = [name for name, *_ in QUANTITIES]
    return (markdown.table(["Model", "Largest difference [%] from 10 / from 30 divisions on", "centre rule, along x", "along z", "smooth rule, along x", "along z"], spread)
            + "\n\n" + markdown.table(["Model", "Grid", "Rule"] + [f"{name}, error / estimate [%]" for name in names], estimated))
