"""Genu's own static and gait runs of a case, through the program."""
import json
import pathlib
import subprocess

import numpy as np

from ..genu import Table
from .limited import NotFinished


class Program:
    def __init__(self, genu, data):
        self.genu, self.data = genu, data

    def _run(self, command, scene, output, grid):
        arguments = [str(self.genu), command, str(scene), "-o", str(output), "--grid", f"{grid}x{grid}", "--no-maps", "--no-plots", "-q"]
        done = subprocess.run(arguments + (["--data", str(self.data)] if self.data else []), capture_output=True, text=True)
        if done.returncode != 0:
            raise NotFinished(f"failed: {(done.stderr or done.stdout).strip().splitlines()[-1]}")
        return json.loads((pathlib.Path(output) / "summary.json").read_text())

    def _repeat(self, repeats, *arguments):
        """The last run and the shortest processor time of the analysis."""
        summaries = [self._run(*arguments) for _ in range(repeats)]
        return summaries[-1], min(s["cpu_time_s"] for s in summaries)

    def static(self, scene, work, grid, repeats=1):
        summary, used = self._repeat(repeats, "static", scene, work, grid)
        pose = summary["at_static_pose"]["pose"]
        return {"time_s": used, "pose": [np.radians(pose[f"{n}_deg"]) for n in ("rx", "ry", "rz")] + [1e-3 * pose[f"{n}_mm"] for n in "xyz"],
                "evaluations": summary["steps"]["contact_evaluations"]}

    def gait(self, scene, work, grid, compartments, repeats=1):
        summary, used = self._repeat(repeats, "gait", scene, work, grid)
        motion, contact = Table(pathlib.Path(work) / "motion.sto"), Table(pathlib.Path(work) / "contact.sto")
        angle = lambda n: np.radians(motion[n])
        poses = np.column_stack([angle("rx"), angle("ry"), angle("rz"), motion["x"], motion["y"], motion["z"]])
        rates = {"rx": float(angle("rx_rate")[0]), "y": float(motion["y_rate"][0]), "z": float(motion["z_rate"][0])}
        forces = np.column_stack([contact[f"{c}.force_y_N"] for c in compartments])
        return {"time_s": used, "poses": poses.tolist(), "forces": forces.tolist(), "rates": rates, "steps": summary["steps"]["steps_taken"],
                "evaluations": summary["steps"]["contact_evaluations"]}
