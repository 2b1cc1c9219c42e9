"""Tests of the Python module: scenes, arrays, files, errors, progress and stopping."""

import pathlib
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import oscura
import pytest

ROOT = pathlib.Path(__file__).parents[3]
BOX = ROOT / "assets" / "cornell-box.gltf"


def furnace(reflectance=0.5):
    """A sphere of a reflectance in front of an environment of radiance 1."""
    scene = oscura.Scene("furnace")
    clay = scene.add_lambert("clay", color=[reflectance] * 3)
    scene.add_sphere((0, 0, 0), 1, clay, name="ball")
    scene.set_environment(color=(1, 1, 1))
    scene.add_camera((0, 0, 5), (0, 0, 0), fov=30)
    return scene


def test_panoramic_camera():
    scene = oscura.Scene("around")
    scene.set_environment(nadir=(0, 0, 0), zenith=(1, 1, 1))
    scene.add_camera((0, 0, 0), (0, 0, -1), panorama="equirectangular", latitude=(0, 90))
    scene.add_camera((0, 0, 0), (0, 1, 0), up=(0, 0, 1), panorama="fisheye_equidistant", fov=180)
    half = oscura.render(scene, samples=16, width=16)["color"]
    assert half.shape == (4, 16, 4)
    # The environment is a gradient by the height of directions.
    np.testing.assert_allclose(half[3, :, 0], (1 + np.sin(np.pi / 16)) / 2, atol=0.05)
    dome = oscura.render(scene, samples=16, width=16, height=16, camera=1)["color"]
    assert dome[8, 8, 0] > 0.98 and dome[0, 0, 0] == 0
    with pytest.raises(oscura.UsageError, match="fisheye"):
        scene.add_camera((0, 0, 0), (0, 0, -1), panorama="cubemap")


def test_version_is_that_of_the_program():
    assert oscura.__version__ == "0.1.0"


def test_file_to_arrays():
    scene = oscura.load(BOX)
    assert scene.triangles > 10 and scene.cameras and scene.materials
    picture = oscura.render(scene, samples=4, width=40, height=30, aovs=["depth", "normal", "object_id"])
    assert picture.keys() == ["color", "depth", "normal", "object_id"]
    assert picture["color"].shape == (30, 40, 4) and picture["color"].dtype == np.float32
    assert picture["depth"].shape == (30, 40, 1) and picture["normal"].shape == (30, 40, 3)
    assert picture["object_id"].dtype == np.uint32 and picture["object_id"].max() > 1
    assert picture.components("normal") == ["N.X", "N.Y", "N.Z"]
    assert set(dict(picture)) == set(picture) and "depth" in picture and "albedo" not in picture
    with pytest.raises(KeyError, match="albedo"):
        picture["albedo"]


def test_furnace_radiance():
    picture = oscura.render(furnace(), samples=64, width=32, height=32, aovs=["depth", "normal"])
    middle, corner = picture["color"][16, 16], picture["color"][0, 0]
    # A convex body of reflectance 0.5 under radiance 1 has radiance 0.5.
    np.testing.assert_allclose(middle, [0.5, 0.5, 0.5, 1], atol=0.01)
    np.testing.assert_allclose(corner, [1, 1, 1, 1], atol=1e-6)
    assert abs(picture["depth"][16, 16, 0] - 4) < 0.02 and picture["depth"][0, 0, 0] == 1e10
    np.testing.assert_allclose(picture["normal"][16, 16], [0, 0, 1], atol=0.1)


def test_meshes_from_arrays():
    scene = oscura.Scene()
    red = scene.add_lambert("red", color=np.array([1, 0, 0]))
    green = scene.add_lambert("green", color=(0, 1, 0))
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], dtype=np.float64)
    square = scene.add_mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]), red, normals=[[0, 0, 1]] * 4)
    scene.add_instance(square, name="left")
    right = np.eye(4)
    right[0, 3] = 2
    scene.add_instance(square, right, material=green, name="right")
    scene.set_environment(color=(1, 1, 1))
    scene.add_camera((1, 0, 10), (1, 0, 0), height=2, aspect_ratio=2)
    assert scene.triangles == 4
    color = oscura.render(scene, samples=64, width=16, height=8)["color"]
    # A reflectance of 1 gives the environment's radiance, up to noise.
    np.testing.assert_allclose(color[4, 3], [1, 0, 0, 1], atol=0.02)
    np.testing.assert_allclose(color[4, 12], [0, 1, 0, 1], atol=0.02)
    assert color[4, 3, 1] == 0 and color[4, 12, 0] == 0


def test_textures_and_vertex_colors():
    scene = oscura.Scene()
    # Black to grey: 188 of sRGB is a linear 0.503.
    pixels = np.array([[[0, 0, 0], [188, 188, 188]]], dtype=np.uint8)
    textured = scene.add_lambert("t", color=(1, 1, 1), texture=scene.add_texture(pixels, wrap="clamp"))
    corners = [[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]
    mesh = scene.add_mesh(
        corners, [[0, 1, 2], [0, 2, 3]], textured, uvs=[[0, 1], [1, 1], [1, 0], [0, 0]]
    )
    scene.add_instance(mesh)
    scene.set_environment(color=(1, 1, 1))
    scene.add_camera((0, 0, 10), (0, 0, 0), height=2, aspect_ratio=1)
    color = oscura.render(scene, samples=64, width=16, height=16)["color"]
    assert color[8, 2, 0] < 0.01 and abs(color[8, 13, 0] - 0.503) < 0.02


def test_every_material_and_light_renders():
    scene = oscura.Scene()
    floor = scene.add_pbr("floor", base_color=(0.5, 0.5, 0.5), roughness=0.9, clearcoat=0.5, sheen_color=(0.1, 0, 0))
    materials = [
        scene.add_metal("gold", color=(1, 0.77, 0.34)),
        scene.add_metal("copper", eta=(0.2, 0.92, 1.1), k=(3.9, 2.45, 2.14)),
        scene.add_glass("glass"),
        scene.add_glass("frosted", roughness=0.3, thin=True),
        scene.add_emitter("lamp", radiance=(2, 2, 2)),
        scene.add_pbr("veil", alpha=0.5),
        scene.add_pbr("milk glass", transmission=1, attenuation_color=(0.5, 0.9, 0.9), attenuation_distance=0.5),
    ]
    for x, material in enumerate(materials):
        scene.add_sphere((x * 1.1, 0.5, 0), 0.5, material)
    scene.add_quad((-2, 0, 2), (12, 0, 0), (0, 0, -4), floor)
    scene.add_disk((3, 3, 0), (0, -1, 0), 0.5, materials[4])
    scene.add_point_light((0, 4, 4), (10, 10, 10), group="key")
    scene.add_spot_light((3, 4, 4), (0, -1, -1), (10, 10, 10), outer_angle=30, group="fill")
    scene.add_sun((0, -1, -0.3), (0.5, 0.5, 0.4), angle=1)
    scene.set_environment(nadir=(0.1, 0.1, 0.1), zenith=(0.2, 0.3, 0.5))
    scene.add_camera((3, 2, 9), (3, 0.5, 0), defocus=0.5)
    picture = oscura.render(scene, samples=4, width=64, height=32, light_groups=True)
    assert np.isfinite(picture["color"]).all() and picture["color"].mean() > 0.05
    assert {"RGBA_key", "RGBA_fill", "RGBA_default"} <= set(picture), picture.keys()
    groups = sum(picture[name] for name in picture if name.startswith("RGBA_"))
    np.testing.assert_allclose(groups, picture["color"][..., :3], rtol=1e-3, atol=1e-4)


def test_determinism():
    scene = oscura.load(BOX)
    call = dict(samples=8, width=24, height=24)
    one = oscura.render(scene, threads=1, **call)["color"]
    two = oscura.render(scene, threads=2, **call)["color"]
    assert (one == two).all()
    assert (one != oscura.render(scene, seed=1, **call)["color"]).any()


def test_files(tmp_path):
    picture = oscura.render(oscura.load(BOX), samples=4, width=20, aovs=["normal"])
    for name, start in [("a.exr", b"v/1\x01"), ("a.png", b"\x89PNG"), ("a.jpg", b"\xff\xd8")]:
        picture.save(tmp_path / name)
        assert (tmp_path / name).read_bytes().startswith(start)
    assert picture._repr_png_().startswith(b"\x89PNG")
    bytes8 = picture.rgba8(view="srgb")
    assert bytes8.shape == (picture.height, 20, 4) and bytes8.dtype == np.uint8
    brighter = picture.rgba8(view="srgb", exposure=1)
    assert brighter.astype(int).sum() > bytes8.astype(int).sum()
    picture.save(str(tmp_path / "b.exr"), float32=True)
    info = subprocess.run(
        [sys.executable, "-m", "oscura", "info", tmp_path / "b.exr"], capture_output=True, text=True
    )
    assert info.returncode == 0 and "N.X" in info.stdout, info


def test_errors_have_the_renderers_text(tmp_path):
    with pytest.raises(oscura.InputError, match="missing.glb"):
        oscura.load(tmp_path / "missing.glb")
    with pytest.raises(oscura.UsageError, match="sideways.*one of auto"):
        oscura.load(BOX, up="sideways")
    scene = furnace()
    with pytest.raises(oscura.UsageError, match="no camera 'side'"):
        oscura.render(scene, camera="side")
    with pytest.raises(oscura.Error, match="no AOV 'colour'.*depth"):
        oscura.render(scene, aovs=["colour"])
    with pytest.raises(oscura.OutputError, match="folder"):
        oscura.render(scene, samples=1, width=8).save(tmp_path / "none" / "a.exr")
    with pytest.raises(oscura.UsageError, match=r"end the name in \.exr"):
        oscura.render(scene, samples=1, width=8).save(tmp_path / "a.xyz")


def test_typos_get_suggestions():
    scene = oscura.Scene()
    clay = scene.add_lambert()
    square = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    with pytest.raises(oscura.UsageError, match="position 3 of 3"):
        scene.add_mesh(square, [[0, 1, 3]], clay)
    with pytest.raises(oscura.UsageError, match="position -1"):
        scene.add_mesh(square, [[0, 1, -1]], clay)
    with pytest.raises(TypeError, match="whole numbers"):
        scene.add_mesh(square, [[0, 1, 1.5]], clay)
    with pytest.raises(oscura.UsageError, match="2 numbers per row instead of 3"):
        scene.add_mesh([[0, 0], [1, 0]], [[0, 1, 0]], clay)
    with pytest.raises(oscura.UsageError, match="normals has 1 rows for 3"):
        scene.add_mesh(square, [[0, 1, 2]], clay, normals=[[0, 0, 1]])
    with pytest.raises(oscura.UsageError, match="no material 7"):
        scene.add_sphere((0, 0, 0), 1, 7)
    with pytest.raises(oscura.UsageError, match="either color or both"):
        scene.add_metal(eta=(1, 1, 1))
    with pytest.raises(oscura.UsageError, match="last row"):
        scene.add_instance(scene.add_mesh(square, [[0, 1, 2]], clay), np.ones((4, 4)))
    scene.add_sphere((0, 0, 0), -1, clay)
    with pytest.raises(oscura.InputError, match="radius"):
        scene.validate()


def test_scene_without_camera_is_completed():
    scene = oscura.Scene()
    scene.add_sphere((0, 1, 0), 1, scene.add_pbr("clay"))
    with pytest.raises(oscura.InputError, match="camera"):
        oscura.render(scene, samples=1)
    scene.complete(view_from="front")
    picture = oscura.render(scene, samples=4, width=32, height=32)
    assert picture["color"][16, 16, 3] == 1 and picture["color"][..., :3].max() > 0.2


def test_progress_comes_in_the_calling_thread():
    shares = []

    def progress(share, seconds):
        assert threading.current_thread() is caller and seconds >= 0
        shares.append(share)

    caller = threading.current_thread()
    oscura.render(oscura.load(BOX), samples=64, width=128, progress=progress)
    assert shares and shares == sorted(shares) and 0 < shares[-1] <= 1


def test_exception_in_progress_stops():
    def progress(share, seconds):
        raise RuntimeError("enough")

    start = time.monotonic()
    with pytest.raises(RuntimeError, match="enough"):
        oscura.render(oscura.load(BOX), samples=1_000_000, width=256, progress=progress)
    assert time.monotonic() - start < 20


def test_time_limit():
    picture = oscura.render(oscura.load(BOX), samples=1_000_000, width=64, time_limit=0.5)
    assert picture.statistics["timed_out"] and picture.statistics["samples_per_pixel"] >= 1


def test_gil_is_released_while_rendering():
    counts = []

    def count():
        while not done.is_set():
            counts.append(time.monotonic())
            time.sleep(0.01)

    done = threading.Event()
    other = threading.Thread(target=count)
    other.start()
    oscura.render(oscura.load(BOX), samples=1_000_000, width=64, time_limit=1)
    done.set()
    other.join()
    assert len(counts) > 20


def test_changes_during_a_render_affect_the_next_one():
    scene, changes = furnace(0.5), []

    def change(share, seconds):
        if not changes:
            changes.append(scene.set_environment(color=(0, 0, 0)))

    call = dict(samples=256, width=128, height=128)
    bright = oscura.render(scene, progress=change, **call)["color"]
    assert changes and abs(bright[64, 64, 0] - 0.5) < 0.05
    assert oscura.render(scene, **call)["color"][64, 64, 0] == 0


def test_denoising_reduces_the_error():
    scene = oscura.load(BOX)
    call = dict(width=48, height=48)
    reference = oscura.render(scene, samples=1024, **call)["color"]
    noisy = oscura.render(scene, samples=4, seed=5, **call)["color"]
    clean = oscura.render(scene, samples=4, seed=5, denoise=True, **call)
    assert clean.keys() == ["color"]

    def error(picture):
        return np.median((picture - reference) ** 2 / (reference**2 + 0.01))

    assert error(clean["color"]) < error(noisy)


@pytest.mark.skipif(sys.platform == "win32", reason="signals are sent otherwise there")
def test_control_c_raises_keyboard_interrupt():
    code = (
        "import oscura, sys\n"
        f"scene = oscura.load({str(BOX)!r})\n"
        "print('ready', flush=True)\n"
        "try:\n"
        "    oscura.render(scene, samples=10_000_000, width=512)\n"
        "except KeyboardInterrupt:\n"
        "    sys.exit(7)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "ready\n"
    time.sleep(1)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=30) == 7


def test_aovs_are_listed():
    names = [name for name, _ in oscura.aovs()]
    assert "depth" in names and "crypto_object" in names
    scene = furnace()
    picture = oscura.render(scene, samples=2, width=8, height=8, aovs=["all"])
    assert set(picture) == {"color", *names}


@pytest.mark.parametrize("dtype", ["int64", "int8", "uint16", "bool", "complex64"])
def test_textures_of_other_types_are_refused(dtype):
    scene = oscura.Scene()
    pixels = np.ones((2, 2, 3), dtype=dtype)
    with pytest.raises(oscura.UsageError, match=rf"{dtype}.*uint8.*float32\(pixels\) / 255"):
        scene.add_texture(pixels)
    with pytest.raises(oscura.UsageError, match=dtype):
        scene.set_environment(image=pixels)
    for fine in ["uint8", "float16", "float32", "float64"]:
        scene.add_texture(pixels.real.astype(fine))


def test_invalid_numbers_are_refused():
    scene = furnace()
    for threads in (0, 1025):
        with pytest.raises(oscura.UsageError, match="threads must be 1 to 1024"):
            oscura.render(scene, samples=1, width=8, threads=threads)
        with pytest.raises(oscura.UsageError, match="threads must be 1 to 1024"):
            oscura.load(BOX, threads=threads)
    for exposure in (float("nan"), float("inf"), 101):
        with pytest.raises(oscura.UsageError, match="exposure must be"):
            oscura.render(scene, samples=1, width=8, exposure=exposure)
