"""Time at an equal error, read off each program's curve."""
import math


def _sure(rows, program, error):
    """(time [s], error) of the settings with a result. A setting that happens to be nearer than a finer one of its family counts as that one: what
    is not known beforehand is no accuracy. One that fell through the layer is no result."""
    families, made = {}, []
    for r in rows:
        if r.program == program and r.time_s and r.errors.get(error) and not r.fell():
            families.setdefault(r.family, []).append(r)
    for family in families.values():
        largest = 0.0
        for r in sorted(family, key=lambda r: -r.fineness):
            largest = max(largest, r.errors[error])
            made.append((r.time_s, largest))
    return made


def front(rows, program, error):
    """(time [s], error) of the settings that no other of the program beats in both, the fastest first."""
    kept = []
    for point in sorted(_sure(rows, program, error)):
        if not kept or point[1] < kept[-1][1]:
            kept.append(point)
    return kept


class Time:
    """s; at_most: even the fastest setting is nearer than asked, so the program may be faster still."""

    def __init__(self, s, at_most=False):
        self.s, self.at_most = s, at_most


def time_at(curve, level):
    """Between two settings: the straight line in the logarithms of error and time. None beyond the nearest one: nothing is extrapolated."""
    if not curve or curve[-1][1] > level:
        return None
    if curve[0][1] <= level:
        return Time(curve[0][0], curve[0][1] < level)
    for (t0, e0), (t1, e1) in zip(curve, curve[1:]):
        if e1 <= level:
            share = math.log(level / e0) / math.log(e1 / e0)
            return Time(t0 * (t1 / t0) ** share)


class Ratio:
    """A peer's time over Genu's. bound: "≥" or "≤" where one of the times is only known to be at most that; None where both are."""

    def __init__(self, own, peer):
        self.value = peer.s / own.s
        self.bound = None if own.at_most and peer.at_most else "≥ " if own.at_most else "≤ " if peer.at_most else ""


def programs(rows):
    return [p for p in dict.fromkeys(r.program for r in rows) if p != "Genu"]


def ratios(rows, program, error, levels):
    """(level, Ratio) where both curves reach."""
    own, peer = front(rows, "Genu", error), front(rows, program, error)
    both = ((level, time_at(own, level), time_at(peer, level)) for level in levels)
    made = [(level, Ratio(a, b)) for level, a, b in both if a and b]
    return [(level, r) for level, r in made if r.bound is not None]
