"""A terminal session as SVG: python terminal.py FILE.svg COMMAND...

Runs the commands, each in quotes, in a folder of their own beside links to `assets` and `scenes`, in a terminal of 100 columns, and
writes what they print as text on a dark window. Lines that a later one replaced (progress) are left out. Needs Linux or macOS.
"""

import os
import pathlib
import pty
import re
import subprocess
import sys
import tempfile
from html import escape

COLUMNS, LINE, CHARACTER = 100, 20, 8.4


def run(command, folder):
    """What a command prints into a terminal, line by line."""
    master, slave = pty.openpty()
    environment = os.environ | {"COLUMNS": str(COLUMNS), "TERM": "dumb", "NO_COLOR": "1"}
    process = subprocess.Popen(command, shell=True, cwd=folder, env=environment, stdout=slave, stderr=slave, stdin=slave)
    os.close(slave)
    printed = b""
    while True:
        try:
            part = os.read(master, 4096)
        except OSError:  # The other end is closed.
            break
        if not part:
            break
        printed += part
    process.wait()
    text = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "\r", printed.decode())
    last = [re.split(r"\r+", line.rstrip("\r"))[-1].rstrip() for line in text.split("\n")]
    return [line for line in last if line]


def svg(lines):
    height = LINE * (len(lines) + 2) + 24
    width = round(CHARACTER * COLUMNS) + 32
    rows = []
    for i, line in enumerate(lines):
        y = 24 + LINE * (i + 2)
        color = "#8fd18f" if line.startswith("$ ") else "#d8d8d8"
        rows.append(f'<text x="16" y="{y}" fill="{color}" xml:space="preserve">{escape(line)}</text>')
    dots = "".join(f'<circle cx="{20 + 18 * i}" cy="18" r="5.5" fill="#555"/>' for i in range(3))
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" width="{width}" height="{height}">\n'
            f'<rect width="{width}" height="{height}" rx="8" fill="#1c1c1c"/>{dots}\n'
            f'<g font-family="ui-monospace, DejaVu Sans Mono, Menlo, Consolas, monospace" font-size="14">\n'
            + "\n".join(rows) + "\n</g>\n</svg>\n")


def main():
    target, commands = pathlib.Path(sys.argv[1]), sys.argv[2:]
    root = pathlib.Path(__file__).resolve().parents[2]
    with tempfile.TemporaryDirectory() as folder:
        for name in ["assets", "scenes"]:
            (pathlib.Path(folder) / name).symlink_to(root / name)
        lines = [line for command in commands for line in [f"$ {command}", *run(command, folder)]]
    wide = [line for line in lines if len(line) > COLUMNS]
    assert not wide, f"wider than the terminal: {wide}"
    target.write_text(svg(lines))


if __name__ == "__main__":
    main()
