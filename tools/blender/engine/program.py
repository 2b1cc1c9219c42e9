"""Runs the program."""

import json
import os
import re
import signal
import subprocess
import sys
import threading

import bpy

from . import preferences

# Seconds that the program has to write its picture after it is asked to stop.
STOP_TIMEOUT = 20.0

PROGRESS = re.compile(r"(\d+(?:\.\d+)?) %  (.*)")


class ProgramError(Exception):
    """The program failed; the message is its own."""


def write_copy(path, scene):
    """Writes a scene in its current state to a file."""
    bpy.data.libraries.write(str(path), {scene}, path_remap="ABSOLUTE", fake_user=False, compress=False)


def arguments(command, blend, output, scene):
    """The arguments that all commands have."""
    chosen = preferences.current()
    found = [preferences.find_program(), command, str(blend), "-o", str(output), "--scene", scene.name]
    found += ["--blender", bpy.app.binary_path or sys.executable]
    if not chosen.use_cache:
        return [*found, "--no-cache"]
    folder = bpy.path.abspath(chosen.cache)
    return [*found, "--cache", folder] if folder else found


class Process:
    """A running program. Threads read its output, so that it never blocks."""

    def __init__(self, command):
        self.progress = 0.0  # from 0 to 1
        self.status = ""
        self.lines = []
        self.is_stopped = False
        # A process group, so that Blender, which the program runs, stops as well.
        group = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP} if os.name == "nt" else {"start_new_session": True}
        pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        try:
            self.process = subprocess.Popen(command, **pipes, **group, encoding="utf-8", errors="replace")
        except OSError as error:
            raise ProgramError(f"{command[0]} can't be run: {error}") from error
        self.outputs = []
        self.readers = [
            threading.Thread(target=self._read_errors, daemon=True),
            threading.Thread(target=lambda: self.outputs.append(self.process.stdout.read()), daemon=True),
        ]
        for reader in self.readers:
            reader.start()

    def _read_errors(self):
        for line in self.process.stderr:
            found = PROGRESS.match(line)
            if found:
                self.progress, self.status = float(found[1]) / 100, found[2].strip()
            else:
                self.lines.append(line.rstrip())

    def wait(self, seconds):
        """Waits at most so many seconds; returns whether the process has ended."""
        try:
            self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            return False
        return True

    def stop(self):
        """Stops the process, which writes its picture first."""
        if self.process.poll() is not None:
            return
        self.is_stopped = True
        if os.name == "nt":
            self.process.send_signal(signal.CTRL_BREAK_EVENT)
        else:
            os.killpg(self.process.pid, signal.SIGTERM)
        if not self.wait(STOP_TIMEOUT):
            self.process.kill()
            self.process.wait()

    def result(self):
        """The report that the program prints at its end; empty without one."""
        for reader in self.readers:
            reader.join()
        self.process.stdout.close()
        self.process.stderr.close()
        try:
            report = json.loads(self.outputs[0].splitlines()[-1])
        except (IndexError, ValueError):
            report = {}
        if self.process.returncode == 0 or self.is_stopped:
            return report
        problems = report.get("error", {}).get("problems")
        message = "\n".join(problems or self.lines[-12:])
        raise ProgramError(message or f"the program ended with exit code {self.process.returncode}")
