"""Table 2: distance methods on one surface in more and more patches, as the benchmark distance_table prints them."""

import math
import re
import subprocess
import sys

from . import markdown
from .published import TABLE2

RUNS = 3  # the shortest of their times: other programs can only lengthen them
# The row of a surface whose method is one of these; a general CAD kernel has another function for several patches, as ACIS had.
MINIMUM_CAD = ("OCCT Extrema_ExtPS, minimum, cold", "OCCT BRepExtrema point-faces, cold")
RAY_CAD = ("OCCT GeomAPI_IntCS ray, cold", "OCCT GeomAPI_IntCS ray, every patch, cold")


def read_rows(text):
    """{(surface, method): shortest time [ns]}"""
    rows = {}
    for line in text.splitlines():
        match = re.match(r"(.{26}) (.{42}) +\d+ +(\d+) +\d+ ", line)
        if match:
            key = match.group(1).strip(), match.group(2).strip()
            rows[key] = min(float(match.group(3)), rows.get(key, math.inf))
    return rows


def write(program):
    text = ""
    for _ in range(RUNS):
        done = subprocess.run([str(program)], capture_output=True, text=True)
        if done.returncode != 0:
            sys.exit(f"compare_with_paper: {program} ended with {done.returncode}: {done.stderr.strip()}")
        text += done.stdout
    rows = read_rows(text)
    deviation = dict(re.findall(r"^(\S+): .* at most ([\d.]+) um", text, re.MULTILINE))

    def time(surface, methods, unit):
        found = [rows[surface, method] for method in methods if (surface, method) in rows]
        return found[0] / unit if found else None

    def cells(ray, minimum, form):
        if ray is None or minimum is None:
            return ["-", "-"]
        return [form % ray + " / " + form % minimum, "%.2g" % (ray / minimum)]

    lines = []
    for patches, lines_uv, error, ray, minimum in TABLE2:
        size = "9x11" if (patches, lines_uv) == ("1", "minimized") else "15x20"
        surface = f"{size}, {patches} patch" + ("" if patches == "1" else "es")
        row = [patches, lines_uv, "-" if error is None else "%.4f" % error, *cells(ray / 1e3, minimum / 1e3, "%.0f"), size.replace("x", " x ")]
        row += cells(*(time(surface, (f"{m}, cold",), 1) for m in ("ray firing", "minimum distance")), "%.0f")
        row += cells(*(time(surface, (f"{m}, tracked",), 1) for m in ("ray firing", "minimum distance")), "%.0f")
        row += cells(time(surface, RAY_CAD, 1e3), time(surface, MINIMUM_CAD, 1e3), "%.0f")
        lines.append(row)
    header = ["Patches", "Lines u-v", "Error [mm]", "Paper: ray / minimum [ms, in all]", "Ratio", "Points here", "Genu, cold [ns]", "Ratio",
              "Genu, tracked [ns]", "Ratio", "Open CASCADE, cold [us]", "Ratio"]
    note = ("Times here: the shortest, for one distance. Largest distance of the patch from the swept condyle it stands for: "
            + ", ".join("%.4f mm (%s)" % (float(deviation[size]) / 1e3, size.replace("x", " x ")) for size in ("15x20", "9x11")) + ".")
    return markdown.table(header, lines) + "\n\n" + note
