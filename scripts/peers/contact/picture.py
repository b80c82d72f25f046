"""Error over processor time of the three comparisons, a row for each knee; gnuplot draws it."""
import shutil
import subprocess

from . import equal_error
from .page import ERRORS, PARTS, SHORT

COLOURS = {"Genu": ("#0060ad", 7), "Drake": ("#dd181f", 5), "OpenSim": ("#2e8b57", 9)}
UNITS = {"contact": (1e3, "ms"), "settle": (1.0, "s"), "gait": (1.0, "s")}


def _panel(rows, part, title, work, name):
    error, quantity, unit, levels = ERRORS[part]
    scale, time = UNITS[part]
    lines = [f"set title '{title}'", f"set xlabel 'processor time [{time}]'", f"set ylabel 'error of the {quantity} [{unit}]'", "unset arrow", "unset label"]
    plots, fronts = [], {p: equal_error.front(rows, p, error) for p in COLOURS}
    for program, (colour, point) in COLOURS.items():
        shown = [(r.time_s, r.errors[error]) for r in rows if r.program == program and r.time_s and 0 < (r.errors.get(error) or 0) < 100]
        if not shown:
            continue
        for what, points in (("all", shown), ("front", [p[:2] for p in fronts[program]])):
            (work / f"{name}_{part}_{program}_{what}.txt").write_text("".join(f"{scale * t} {e}\n" for t, e in points))
        data = work / f"{name}_{part}_{program}"
        plots += [f"'{data}_front.txt' with lines linewidth 1.5 linecolor rgb '{colour}' notitle",
                  f"'{data}_all.txt' with points pointtype {point} pointsize 1.1 linecolor rgb '{colour}' title '{program}'"]
        found = equal_error.ratios(rows, program, error, levels) if program != "Genu" else []
        if found:
            level, ratio = found[-1]
            a, b = (scale * equal_error.time_at(fronts[p], level).s for p in ("Genu", program))
            lines += [f"set arrow from {a},{level} to {b},{level} heads size screen 0.004,20 linewidth 1.2 linecolor rgb '{colour}' front",
                      f"set label '{ratio.bound}{ratio.value:.2g} times'".replace("e+03", "000") + f" at {(a * b) ** 0.5},{level} center offset 0,0.6 textcolor rgb '{colour}' front"]
    if not plots:
        return []
    return lines + ["plot " + ", ".join(plots)]


def draw(measured, file, work):
    """Whether a picture was drawn."""
    panels = {name: [p for p in PARTS if p in m] for name, m in measured.items()}
    if shutil.which("gnuplot") is None:
        print("no picture: there is no gnuplot")
        return False
    work.mkdir(parents=True, exist_ok=True)
    script = [f"set terminal pngcairo size 1440,{440 * len(panels)} font 'sans,10'", f"set output '{file}'", f"set multiplot layout {len(panels)},3",
              "set logscale xy", "set grid", "set format '%g'", "set key outside bottom center horizontal", "set offsets graph 0.05, graph 0.05, graph 0.05, graph 0.05"]
    for name, parts in panels.items():
        for part in PARTS:
            drawn = _panel(measured[name][part]["rows"], part, f"{PARTS[part].capitalize()}, {SHORT[name]}", work, name) if part in parts else []
            script += drawn or ["set multiplot next"]
    (work / "picture.gp").write_text("\n".join(script) + "\n")
    subprocess.run(["gnuplot", str(work / "picture.gp")], check=True)
    return True
