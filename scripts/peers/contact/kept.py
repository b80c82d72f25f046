"""Measured cases, a file each: a run that is broken off loses nothing, and a page can be made again without measuring."""
import datetime
import json
import math
import os
import time

from .limited import NotFinished

SHORT_S = 4  # of processor time, building included


class NotMeasured(Exception):
    """Neither measured before nor now."""


def _same(a, b):
    """Equal but for rounding: a reference pose computed by another build differs in the last digits."""
    if isinstance(a, dict) and isinstance(b, dict):
        return a.keys() == b.keys() and all(_same(a[k], b[k]) for k in a)
    if isinstance(a, list) and isinstance(b, list):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b))
    if isinstance(a, float) and isinstance(b, float):
        return math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-8)
    return a == b


class Kept:
    """mode: "all" measures everything; "continue" what has no result yet; "short" Genu's and what took at most SHORT_S the last time; "none" nothing.
    peers: those that may be measured; of the others the results of the last time are taken."""

    def __init__(self, folder, mode, peers, progress):
        self.folder, self.mode, self.peers, self.progress = folder, mode, peers, progress
        self._now = set()

    def last(self, job):
        try:
            return json.loads((self.folder / f"{job.name}.json").read_text())
        except (FileNotFoundError, json.JSONDecodeError):
            return None

    def will_measure(self, job, limit_s, what=None):
        """what: the arguments, where they are known."""
        if job.name in self._now or self.mode == "none" or job.peer() not in ("Genu", *self.peers):
            return False
        last = self.last(job)
        if self.mode == "short":
            return last is not None and (last["cpu_s"] <= SHORT_S or job.program == "Genu")
        stale = last is None or (what is not None and not _same(last["what"], what)) or (last["stopped"] and last["limit_s"] < min(limit_s, job.limit_s or limit_s))
        return self.mode == "all" or bool(stale)

    def get(self, job, limit_s, what, measure):
        """measure(limit_s, tick) returns the result; what: the arguments that it depends on. Raises NotFinished or NotMeasured."""
        what = json.loads(json.dumps(what))
        if self.will_measure(job, limit_s, what):
            self._measure(job, min(limit_s, job.limit_s or limit_s), what, measure)
        last = self.last(job)
        if last is None:
            raise NotMeasured("not measured")
        if not _same(last["what"], what):
            raise NotMeasured("measured before with other arguments")
        if last["stopped"]:
            raise NotFinished(last["stopped"])
        return last["result"]

    def _measure(self, job, limit_s, what, measure):
        self.progress.begin(job)
        begin, result, stopped = _cpu_s(), None, None
        try:
            result = measure(limit_s, self.progress.tick)
        except NotFinished as reason:
            stopped = str(reason)
        record = {"what": what, "result": result, "stopped": stopped, "limit_s": limit_s, "cpu_s": _cpu_s() - begin,
                  "date": datetime.date.today().isoformat(), "load": os.getloadavg()[0]}
        self.folder.mkdir(parents=True, exist_ok=True)
        file = self.folder / f"{job.name}.json"
        fresh = file.with_suffix(".new")  # whole or not at all
        fresh.write_text(json.dumps(record))
        fresh.replace(file)
        self._now.add(job.name)
        self.progress.end(job, record["cpu_s"], stopped)


def _cpu_s():
    t = os.times()
    return t.user + t.system + t.children_user + t.children_system


class Progress:
    """Says which case runs and how long all of them will still take, from their expected costs and the pace so far."""

    def __init__(self, costs, out):
        """costs: key() -> expected seconds, of all that will be measured."""
        self.costs, self.out, self.number, self.total = dict(costs), out, 0, len(costs)
        self.done_s = self.used_s = 0.0
        self.title = ""

    def _left_s(self, running_s=0.0):
        # A fifth of a minute of prior knowledge: the first cases do not throw the estimate about.
        pace = (self.used_s + 12) / (self.done_s + 12)
        return max(0.0, sum(self.costs.values()) * pace - running_s)

    @staticmethod
    def key(title, job):
        return f"{title}: {job.program}, {job.setting}" + ("" if job.role == "row" else f" ({job.role})")

    def begin(self, job):
        self.number += 1
        self.begun = time.monotonic()
        self.text = self.key(self.title, job)
        self._show(0.0)

    def _show(self, running_s):
        left = self._left_s(min(running_s, self.costs.get(self.text, running_s)))
        line = f"[{self.number}/{max(self.number, self.total)}, {_duration(left)} left] {self.text}"
        if self.out.isatty():
            self.out.write("\r\033[K" + line + (f" ... {running_s:.0f} s" if running_s >= 2 else ""))
            self.out.flush()
        elif running_s == 0:
            print(line, file=self.out, flush=True)

    def tick(self, elapsed_s):
        self._show(elapsed_s)

    def end(self, job, cpu_s, stopped):
        self.used_s += time.monotonic() - self.begun
        self.done_s += self.costs.pop(self.text, 0.0)
        if self.out.isatty():
            self.out.write("\r\033[K")
        if stopped or self.out.isatty():
            print(f"  {self.text}: " + (stopped or f"{cpu_s:.1f} s with building"), file=self.out, flush=True)


def _duration(seconds):
    return f"{seconds:.0f} s" if seconds < 90 else f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
