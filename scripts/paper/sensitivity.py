"""Fig. 6: contact in one pose against the number of elements along x and along z, with the paper's rule (whole elements) and
with the smooth one, and the estimates of the error."""

from . import markdown, plots
from .results import QUANTITIES, SIDES, at_pose, errors, read_scene, read_summary, sides, values, with_rule, write_scene

DIVISIONS = (10, 12, 14, 16, 18, 20, 22, 25, 28, 30, 35, 40, 45, 50, 60, 70, 80, 90, 100)
SQUARES = (10, 20, 30, 50, 100)
OTHER = 50  # elements along the other direction: the grid of the paper's pressures
FINEST = 400
RULES = ("centre", "smooth")
DIRECTIONS = ("x", "z")
FLOOR = 1e-4  # [%], the lowest of the logarithmic axes


def pose_text(pose):
    names = (("rx", "deg"), ("ry", "deg"), ("rz", "deg"), ("x", "mm"), ("y", "mm"), ("z", "mm"))
    return ", ".join(f"{pose[name + '_' + unit]!r} {unit}" for name, unit in names)


class Sensitivity:
    def __init__(self, run, model, gait):
        """gait: folder of the linear run, whose pose at maximum load is used."""
        self.run, self.model = run, model
        text = read_scene(f"{model}/gait.yaml")
        self.scenes = {rule: write_scene(run.output / "scenes", f"{model}_{rule}", with_rule(text, rule)) for rule in RULES}
        self.pose = pose_text(at_pose(read_summary(gait))["pose"])
        self.reference = self.evaluate("smooth", FINEST, FINEST)[0]
        self.lines = {(rule, d): [(n, *self.percent(rule, *grid(d, n))) for n in DIVISIONS] for rule in RULES for d in DIRECTIONS}
        self.squares = {rule: [(n, *self.percent(rule, n, n)) for n in SQUARES] for rule in RULES}

    def evaluate(self, rule, nx, nz):
        """Values and estimated errors: [side][quantity]."""
        contact = self.run.contact(self.scenes[rule], self.pose, f"{nx}x{nz}")
        return [values(load) for load in sides(contact)], [errors(load) for load in sides(contact)]

    def percent(self, rule, nx, nz):
        """Differences from the finest grid and estimated errors, in per cent of the finest grid's values."""
        numbers, estimates = self.evaluate(rule, nx, nz)
        return ([[100 * (n / r - 1) for n, r in zip(*side)] for side in zip(numbers, self.reference)],
                [[100 * e / r for e, r in zip(*side)] for side in zip(estimates, self.reference)])


def grid(direction, number):
    return (number, OTHER) if direction == "x" else (OTHER, number)


def xlabel(direction, quantity):
    other = "z" if direction == "x" else "x"
    return f"elements along {direction}, {OTHER} along {other}" if quantity + 1 == len(QUANTITIES) else ""


def draw_values(sensitivities, picture):
    """As the paper's figure: values, here as differences from the finest grid, on one scale."""
    points, line = "with linespoints lw 1.8 ps 0.8", "with lines lw 2.5"
    styles = {("centre", 0): f"{points} pt 7 lc rgb '{plots.COLORS[0]}'", ("centre", 1): f"{points} pt 5 lc rgb '{plots.COLORS[1]}'",
              ("smooth", 0): f"{line} dt 2 lc rgb '{plots.COLORS[2]}'", ("smooth", 1): f"{line} dt 3 lc rgb '{plots.COLORS[3]}'"}
    panels = []
    for q, (name, *_) in enumerate(QUANTITIES):
        row = []
        for s in sensitivities:
            for d in DIRECTIONS:
                curves = []
                for (rule, side), style in styles.items():
                    curves.append(plots.Curve([(n, difference[side][q]) for n, difference, _ in s.lines[rule, d]], style))
                row.append(plots.Panel(curves, title=f"{s.model}, along {d}" if q == 0 else "", ylabel="" if row else f"{name} (%)", xlabel=xlabel(d, q),
                                       settings="set xrange [5:105]; set yrange [-25:25]; set ytics 10; set xzeroaxis lc rgb '#404040' lt 1 lw 1"))
        panels.append(row)
    key = [(f"{rule} rule, {SIDES[side]}", style) for (rule, side), style in styles.items()]
    plots.draw(picture, panels, key, panel_size=(330, 170), gap_x=55, gap_y=24)


def draw_errors(s, picture):
    """Differences from the finest grid on a logarithmic axis, and the estimates that the program gives without that grid."""
    true = {rule: f"with points pt 7 ps 0.9 lc rgb '{color}'" for rule, color in zip(RULES, plots.COLORS)}
    estimated = {rule: f"with lines lw 2 dt 2 lc rgb '{color}'" for rule, color in zip(RULES, plots.COLORS)}
    axis = (f"set xrange [5:105]; set logscale y; set yrange [{FLOOR}:300]; "
            "set ytics ('1e-4' 1e-4, '0.001' 1e-3, '0.01' 1e-2, '0.1' 0.1, '1' 1, '10' 10, '100' 100)")
    panels = []
    for q, (name, *_) in enumerate(QUANTITIES):
        row = []
        for side, text in enumerate(SIDES):
            for d in DIRECTIONS:
                curves = []
                for rule in RULES:
                    line = s.lines[rule, d]
                    curves += [plots.Curve([(n, max(FLOOR, estimate[side][q])) for n, _, estimate in line], estimated[rule]),
                               plots.Curve([(n, max(FLOOR, abs(difference[side][q]))) for n, difference, _ in line], true[rule])]
                row.append(plots.Panel(curves, title=f"{text}, along {d}" if q == 0 else "", ylabel="" if row else f"{name} (%)", xlabel=xlabel(d, q),
                                       settings=axis))
        panels.append(row)
    key = []
    for rule in RULES:
        key += [(f"{rule} rule: difference from {FINEST} x {FINEST}", true[rule]), ("estimate", estimated[rule])]
    plots.draw(picture, panels, key, panel_size=(330, 190), left=120, gap_x=70, gap_y=24)


def find_largest(line, quantity, least):
    """Largest difference on either side from `least` divisions on."""
    return max(abs(side[quantity]) for n, difference, _ in line if n >= least for side in difference)


def write(sensitivities, folder):
    """The text; pictures paper_sensitivity.png and paper_errors_MODEL.png."""
    draw_values(sensitivities, folder / "paper_sensitivity.png")
    names = [name for name, *_ in QUANTITIES]
    spread, estimated = [], []
    covered = {rule: [0, 0] for rule in RULES}
    for s in sensitivities:
        draw_errors(s, folder / f"paper_errors_{s.model}.png")
        for q, name in enumerate(names):
            largest = [[markdown.digits(find_largest(s.lines[rule, d], q, least), 2) for least in (10, 30)] for rule in RULES for d in DIRECTIONS]
            spread.append([s.model, name] + [" / ".join(pair) for pair in largest])
        for i, n in enumerate(SQUARES):
            for rule in RULES:
                _, difference, estimate = s.squares[rule][i]
                row = [s.model, f"{n} x {n}", rule]
                for q in range(len(QUANTITIES)):
                    side = max((0, 1), key=lambda k: abs(difference[k][q]))
                    row.append(markdown.digits(abs(difference[side][q]), 1) + " / " + markdown.digits(estimate[side][q], 1))
                estimated.append(row)
        for rule in RULES:
            for _, difference, estimate in [found for d in DIRECTIONS for found in s.lines[rule, d]] + s.squares[rule]:
                for side in (0, 1):
                    covered[rule][0] += sum(abs(a) <= b for a, b in zip(difference[side], estimate[side]))
                    covered[rule][1] += len(QUANTITIES)
    header = ["Model", "Largest difference [%] from 10 / from 30 elements on"] + [f"{rule} rule, along {d}" for rule in RULES for d in DIRECTIONS]
    text = markdown.table(header, spread)
    text += "\n\n" + markdown.table(["Model", "Grid", "Rule"] + [f"{name}: error / estimate [%]" for name in names], estimated)
    cases = " and in ".join(f"{a} of {b} cases ({rule} rule)" for rule, (a, b) in covered.items())
    return text + f"\n\nThe estimate covers the difference in {cases}."
