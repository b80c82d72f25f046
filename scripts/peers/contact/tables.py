"""Tables in Markdown."""
from . import equal_error


def number(value, digits=2):
    if value is None:
        return "–"
    return f"{value:.{digits}g}" if 1e-3 <= abs(value) < 10**digits else f"{value:.0f}" if abs(value) >= 10**digits else f"{value:.1e}"


def table(header, rows):
    return ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)] + ["| " + " | ".join(str(c) for c in r) + " |" for r in rows] + [""]


def ratio(r):
    """Two digits: more are not known."""
    return "–" if r is None or r.bound is None else f"{r.bound}{float(f'{r.value:.2g}'):g}"


def at_equal_error(rows, error, levels, unit):
    """A line for each level: what each program takes on its curve, and the peers' over Genu's."""
    programs = equal_error.programs(rows)
    header = [f"Error [{unit}]", "Genu [ms]"] + [x for p in programs for x in (f"{p} [ms]", f"{p} / Genu")]
    curves = {p: equal_error.front(rows, p, error) for p in ["Genu", *programs]}

    def cell(program, level):
        curve, at = curves[program], equal_error.time_at(curves[program], level)
        if at:
            return ("≤ " if at.at_most else "") + number(1e3 * at.s, 3)
        return f"{number(curve[-1][1])} {unit} at {number(1e3 * curve[-1][0], 3)}" if curve else "no result"

    lines = []
    for level in levels:
        own = equal_error.time_at(curves["Genu"], level)
        line = [f"{level:g}", cell("Genu", level)]
        for p in programs:
            peer = equal_error.time_at(curves[p], level)
            line += [cell(p, level), f"**{ratio(equal_error.Ratio(own, peer))}**" if own and peer else "–"]
        lines.append(line)
    return table(header, lines)


def settings(rows, errors, extra):
    """All rows. errors: (key, heading); extra: (key of more, heading). A column that is empty throughout is left out."""
    show = lambda v: "–" if v is None else v if isinstance(v, str) else str(v) if isinstance(v, int) else number(v)
    extra = [(k, h) for k, h in extra if any(r.more.get(k) is not None for r in rows)]
    missing = [r for r in rows if r.note.startswith("not measured")]
    rows = [r for r in rows if r not in missing]
    header = ["Program", "Setting", "Time [ms]"] + [h for _, h in errors] + [h for _, h in extra] + [""]
    lines = table(header, [[r.program, r.setting, number(r.time_s and 1e3 * r.time_s, 3)] + [number(r.errors.get(k)) for k, _ in errors] +
                           [show(r.more.get(k)) for k, _ in extra] + [_note(r)] for r in rows])
    return lines + (["Not measured: " + "; ".join(f"{r.program} {r.setting}" for r in missing) + ".", ""] if missing else [])


def _note(row):
    if row.fell():
        return "falls through the layer"
    return row.note.replace("|", "\\|")
