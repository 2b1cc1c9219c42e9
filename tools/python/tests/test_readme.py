"""The programs of README.md run and write the expected files."""

import pathlib
import re
import shutil

README = pathlib.Path(__file__).parents[1] / "README.md"
BOX = README.parents[2] / "assets" / "cornell-box.gltf"


def test_programs_of_the_readme(tmp_path, monkeypatch):
    (tmp_path / "assets").mkdir()
    shutil.copy(BOX, tmp_path / "assets")
    monkeypatch.chdir(tmp_path)
    programs = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    assert len(programs) == 2
    for program in programs:
        exec(compile(program, str(README), "exec"), {})
    for name in ["cornell.exr", "cornell.png", "scene.png"]:
        assert (tmp_path / name).stat().st_size > 1000, name
