"""Pictures by gnuplot: panels in a grid, curves in each."""

import subprocess
import sys

COLORS = ["#0b5fa5", "#d1495b", "#2a9d8f", "#e09f3e", "#6c4a9e", "#555555"]


class Curve:
    """points: rows of numbers; style: gnuplot's, after the data."""

    def __init__(self, points, style, using="1:2"):
        self.points, self.style, self.using = points, style, using


class Panel:
    def __init__(self, curves, title="", xlabel="", ylabel="", settings=""):
        self.curves, self.title, self.xlabel, self.ylabel, self.settings = curves, title, xlabel, ylabel, settings


def quote(text):
    return "'" + text.replace("'", "''") + "'"


def draw(file, rows, key, panel_size=(560, 260), left=100, gap_x=100, gap_y=36):
    """rows: lists of panels, one axis of x for all of a column. key: [(title, style)], drawn once, above all panels."""
    down, across = len(rows), max(len(row) for row in rows)
    right, top, bottom = 25, 80, 72
    width = left + right + across * panel_size[0] + (across - 1) * gap_x
    height = top + bottom + down * panel_size[1] + (down - 1) * gap_y
    script = [f"set terminal pngcairo size {width},{height} font 'DejaVu Sans,14' background rgb 'white' noenhanced",
              f"set output {quote(str(file))}", "set border lc rgb '#404040' lw 1", "set tics nomirror out scale 0.6",
              "set grid lc rgb '#dddddd' lt 1 lw 1", "set multiplot"]
    count = 0
    for i, row in enumerate(rows):
        for j, panel in enumerate(row):
            x0 = left + j * (panel_size[0] + gap_x)
            y1 = height - top - i * (panel_size[1] + gap_y)
            plots = []
            for curve in panel.curves:
                count += 1
                script.append(f"$data{count} << EOD")
                script += [" ".join(f"{number:.9g}" for number in point) for point in curve.points]
                script.append("EOD")
                plots.append(f"$data{count} using {curve.using} {curve.style} notitle")
            script += ["set lmargin at screen %.5f" % (x0 / width), "set rmargin at screen %.5f" % ((x0 + panel_size[0]) / width),
                       "set tmargin at screen %.5f" % (y1 / height), "set bmargin at screen %.5f" % ((y1 - panel_size[1]) / height),
                       "unset key", "set format x " + ("'%g'" if i + 1 == down else "''"),
                       f"set title {quote(panel.title)} offset 0,-0.6", f"set xlabel {quote(panel.xlabel)} offset 0,0.2",
                       f"set ylabel {quote(panel.ylabel)}", panel.settings, "plot " + (", ".join(plots) or "NaN notitle")]
    # The key: a frame without anything else in it per entry, side by side in the middle.
    script += ["set lmargin at screen 0", "set rmargin at screen 1", "set tmargin at screen 1", f"set bmargin at screen {1 - 40 / height:.5f}",
               "unset border", "unset tics", "unset grid", "unset title", "unset xlabel", "unset ylabel", "unset logscale", "unset xzeroaxis",
               "set xrange [0:1]", "set yrange [0:1]"]
    lengths = [95 + 9 * len(title) for title, _ in key]
    x = (width - sum(lengths)) / 2
    for (title, style), length in zip(key, lengths):
        script += [f"set key at screen {x / width:.5f}, screen {1 - 22 / height:.5f} left center Left reverse samplen 3",
                   f"plot NaN {style} title {quote(title)}"]
        x += length
    script.append("unset multiplot")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.with_suffix(".gp").write_text("\n".join(script) + "\n")
    try:
        done = subprocess.run(["gnuplot", str(file.with_suffix(".gp"))], capture_output=True, text=True)
    except FileNotFoundError:
        sys.exit("compare_with_paper: gnuplot is not installed (Debian: gnuplot-nox)")
    if done.returncode != 0:
        sys.exit("compare_with_paper: gnuplot failed on " + str(file.with_suffix(".gp")) + ": " + done.stderr.strip())
