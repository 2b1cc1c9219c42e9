"""The program in the wheel, and its type stubs."""

import pathlib
import shutil
import signal
import subprocess
import sys
import sysconfig
import time

import pytest

ROOT = pathlib.Path(__file__).parents[3]
BOX = ROOT / "assets" / "cornell-box.gltf"
PROGRAM = shutil.which("oscura", path=sysconfig.get_path("scripts"))


def run(*words, **more):
    return subprocess.run([PROGRAM, *map(str, words)], capture_output=True, text=True, **more)


def test_program_is_installed():
    assert PROGRAM, "the wheel installs the command"
    assert run("--version").stdout == "oscura 0.1.0\n"
    module = subprocess.run([sys.executable, "-m", "oscura", "--version"], capture_output=True, text=True)
    assert module.stdout == "oscura 0.1.0\n"


def test_it_renders(tmp_path):
    done = run("render", BOX, "-o", tmp_path / "a.png", "--width", 24, "--spp", 2)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


def test_exit_codes():
    assert run("render").returncode == 2
    missing = run("render", "missing.glb", "-o", "a.png")
    assert missing.returncode == 3 and "missing.glb" in missing.stderr
    assert run("--help").returncode == 0 and "Usage: oscura" in run("--help").stdout


def test_it_runs_twice_in_a_process(tmp_path):
    script = """
import sys
from oscura._oscura import run_program
for name in ["a.png", "b.png"]:
    words = ["oscura", "render", sys.argv[1], "-o", name, "--width", "8", "--spp", "1", "--quiet"]
    assert run_program(words) == 0, name
"""
    words = [sys.executable, "-c", script, str(BOX)]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.png", "b.png"]


@pytest.mark.skipif(sys.platform == "win32", reason="signals are sent otherwise there")
def test_control_c_writes_the_picture(tmp_path):
    picture = tmp_path / "a.png"
    words = ["render", BOX, "-o", picture, "--width", "256", "--spp", "1000000"]
    process = subprocess.Popen([PROGRAM, *map(str, words)], stderr=subprocess.DEVNULL)
    time.sleep(2)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=30) == 130
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_stubs_match_the_module():
    pytest.importorskip("mypy")
    words = [sys.executable, "-m", "mypy.stubtest", "oscura"]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
