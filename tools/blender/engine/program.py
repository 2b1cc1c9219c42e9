"""Runs the program as a child, and tells what it says."""

import json
import os
import re
import signal
import subprocess
import sys
import threading

import bpy

from . import preferences

# How long a child that was asked to stop may take to write what it has, seconds.
GRACE = 20.0

PROGRESS = re.compile(r"(\d+(?:\.\d+)?) %  (.*)")


class ProgramError(Exception):
    """The program failed; the message is what it says."""


def write_copy(path, scene):
    """Writes a scene as it is now, saved or not, to a file of its own."""
    bpy.data.libraries.write(str(path), {scene}, path_remap="ABSOLUTE", fake_user=False, compress=False)


def arguments(command, blend, output, scene):
    """The arguments that are the same for all commands about a scene in a file of its own."""
    chosen = preferences.current()
    found = [preferences.find_program(), command, str(blend), "-o", str(output), "--scene", scene.name]
    found += ["--blender", bpy.app.binary_path or sys.executable]
    if not chosen.use_cache:
        return [*found, "--no-cache"]
    folder = bpy.path.abspath(chosen.cache)
    return [*found, "--cache", folder] if folder else found


class Child:
    """A running program. Its standard error is read as it comes, so that it never waits for us."""

    def __init__(self, command):
        self.progress = 0.0  # from 0 to 1
        self.status = ""
        self.lines = []
        self.is_stopped = False
        # Of a group of its own, that it can be stopped with the Blender that it runs.
        group = {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP} if os.name == "nt" else {"start_new_session": True}
        pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
        try:
            self.process = subprocess.Popen(command, **pipes, **group, encoding="utf-8", errors="replace")
        except OSError as error:
            raise ProgramError(f"{command[0]} can't be run: {error}") from error
        self.answers = []
        self.readers = [
            threading.Thread(target=self._read_errors, daemon=True),
            threading.Thread(target=lambda: self.answers.append(self.process.stdout.read()), daemon=True),
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
        """Waits for its end at most so long; says whether it has ended."""
        try:
            self.process.wait(seconds)
        except subprocess.TimeoutExpired:
            return False
        return True

    def stop(self):
        """Lets it write what it has, and ends it."""
        if self.process.poll() is not None:
            return
        self.is_stopped = True
        if os.name == "nt":
            self.process.send_signal(signal.CTRL_BREAK_EVENT)
        else:
            os.killpg(self.process.pid, signal.SIGTERM)
        if not self.wait(GRACE):
            self.process.kill()
            self.process.wait()

    def answer(self):
        """What it says at its end: the report on its run, empty if there is none."""
        for reader in self.readers:
            reader.join()
        self.process.stdout.close()
        self.process.stderr.close()
        try:
            report = json.loads(self.answers[0].splitlines()[-1])
        except (IndexError, ValueError):
            report = {}
        if self.process.returncode == 0 or self.is_stopped:
            return report
        problems = report.get("error", {}).get("problems")
        said = "\n".join(problems or self.lines[-12:])
        raise ProgramError(said or f"the program ended with {self.process.returncode} and said nothing")
