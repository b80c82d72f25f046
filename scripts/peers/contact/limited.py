"""Runs a task in a process of its own, within limits of processor time and memory: one program's memory and failures are not another's."""
import json
import os
import pathlib
import resource
import signal
import subprocess
import sys
import time

MEMORY_GB = 10


class NotFinished(Exception):
    """Why there is no result."""


def run(task, work, limit_s, tick=lambda elapsed_s: None, **arguments):
    """task: 'module:function' of this package; returns what it returns, through JSON, and memory_MB. limit_s: processor time, building the
    model included. tick is called every second with the time since the start."""
    work = pathlib.Path(work).resolve()
    work.mkdir(parents=True, exist_ok=True)
    given, got, said, reached = (work / f"task.{end}" for end in ("json", "result.json", "txt", "reached"))
    given.write_text(json.dumps({"task": task, "arguments": arguments}))
    for stale in (got, reached):
        stale.unlink(missing_ok=True)

    def limit():
        resource.setrlimit(resource.RLIMIT_CPU, (int(limit_s), int(limit_s) + 5))
        resource.setrlimit(resource.RLIMIT_AS, (int(MEMORY_GB * 10**9),) * 2)

    # One thread: times are of one core. A session of its own: Ctrl-C reaches this process, which then ends that one.
    environment = dict(os.environ, OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", GENU_PEERS_REACHED=str(reached))
    begin = time.monotonic()
    with open(said, "w") as output:
        process = subprocess.Popen([sys.executable, "-m", __name__, str(given), str(got)], stdout=output, stderr=output, env=environment,
                                   preexec_fn=limit, start_new_session=True)
        try:
            ended, ticks = 0, 0
            while not ended:
                time.sleep(0.05)
                ended, code, used = os.wait4(process.pid, os.WNOHANG)
                if time.monotonic() - begin > ticks + 1:
                    ticks += 1
                    tick(time.monotonic() - begin)
            status = process.returncode = os.waitstatus_to_exitcode(code)
        except BaseException:
            process.kill()
            process.wait()
            raise
    if status == -signal.SIGXCPU:
        raise NotFinished(f"stopped after {limit_s:.0f} s of processor time" + (f", {reached.read_text()}" if reached.exists() else ""))
    if status != 0:
        lines = [line.strip() for line in said.read_text(errors="replace").splitlines() if line.strip()]
        memory_GB = used.ru_maxrss / 1024**2
        # Some die of a refused allocation without a word of it.
        memory = f", at {memory_GB:.1f} of {MEMORY_GB} GB of memory" if memory_GB > 0.5 * MEMORY_GB else ""
        raise NotFinished(f"failed: {lines[-1] if lines else f'status {status}'}{memory}")
    return json.loads(got.read_text())


def reach(text):
    """Called by a task: how far it is, for the case that it is stopped."""
    file = os.environ.get("GENU_PEERS_REACHED")
    if file:
        pathlib.Path(file).write_text(text)


def _main():
    import importlib

    given = json.loads(pathlib.Path(sys.argv[1]).read_text())
    module, function = given["task"].split(":")
    result = getattr(importlib.import_module(f"{__package__}.{module}"), function)(**given["arguments"])
    result["memory_MB"] = round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
    pathlib.Path(sys.argv[2]).write_text(json.dumps(result))


if __name__ == "__main__":
    _main()
