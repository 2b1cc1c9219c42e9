"""Physically correct pictures of 3D scenes, on the CPU.

Units and conventions: metres; y points up; colours are linear Rec. 709 and scene-referred; emission is radiance; angles are
degrees. Ids of materials, textures and meshes are numbers from 0, in the order in which they were added.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from typing import Any, Literal, final

import numpy as np
import numpy.typing as npt

__all__ = [
    "Error",
    "InputError",
    "OutputError",
    "UsageError",
    "load",
    "Picture",
    "render",
    "Scene",
    "aovs",
    "run_program",
    "__version__",
]

__version__: str

_Path = str | os.PathLike[str]
_Vector = Sequence[float] | npt.NDArray[Any]
_Choice = Literal["on", "off"]
_Choice3 = Literal["auto", "on", "off"]
_Stage = Literal["studio", "sky", "sunset", "white", "soft", "none"]
_Ground = Literal["none", "shadow", "floor"]
# A name, or the path of a table (.csp).
_View = str | Literal["srgb", "filmic", "agx", "agx-punchy", "pbr-neutral", "false-color", "gamma"]

class Error(Exception):
    """Something that the renderer refuses or that failed; its text names file, place and remedy."""

class UsageError(Error):
    """Arguments that make no sense, or not together."""

class InputError(Error):
    """A scene or file that is missing, broken or not supported; all its problems at once."""

class OutputError(Error):
    """A file that could not be written."""

def run_program(words: Sequence[str | os.PathLike[str]]) -> int:
    """Runs the program with these words, the first of which is its name; returns its exit code."""

def aovs() -> list[tuple[str, str]]:
    """The names of all AOVs, for `render(aovs=...)`, with what each shows."""

def load(
    path: _Path,
    *,
    allow_external: bool = False,
    up: Literal["auto", "x", "y", "z", "-x", "-y", "-z"] = "auto",
    stage: _Stage = "studio",
    ground: _Ground | None = None,
    background: Literal["transparent"] | _Vector | None = None,
    view_from: str | None = None,
    zoom: float = 1.0,
    fov: float = 30.0,
    point_radius: float | None = None,
    smooth: float | None = None,
    subdivide: int | None = None,
    sidecar: bool = True,
    time: float | None = None,
    scene: str | None = None,
    node: str | None = None,
    variant: str | None = None,
    light_units: Literal["auto", "spec", "compat", "raw"] = "auto",
    glass: Literal["auto", "solid", "thin", "panes"] = "auto",
    force: bool = False,
    blender: _Path | None = None,
    threads: int | None = None,
) -> Scene:
    """Loads a scene: .gltf, .glb, .obj, .ply, .toml or .blend, told apart by the extension.

    A model without camera and light is framed and lit, as `oscura render` does: `stage`, `ground`, `background`,
    `view_from` (a name such as "front", or azimuth and elevation such as "30,20"), `zoom` (0.001 to 1000) and `fov` (vertical,
    degrees) choose how. `background` is "transparent" or linear red, green, blue. The other arguments are the options of
    `oscura render` of the same names (`smooth` in degrees, `subdivide` in levels). `threads`: 1 to 1024, one a core unless given.

    Raises `InputError` with all problems of the file. Ctrl-C takes effect when loading has ended.
    """

def render(
    scene: Scene,
    *,
    samples: int | None = None,
    width: int | None = None,
    height: int | None = None,
    max_depth: int | None = None,
    seed: int | None = None,
    camera: str | int | None = None,
    aovs: Sequence[str] = ...,
    light_groups: bool = False,
    crypto_levels: int = 6,
    denoise: bool = False,
    caustics: _Choice3 = "auto",
    guiding: _Choice = "off",
    path_reuse: str = "auto",
    splitting: str = "auto",
    time_limit: float | None = None,
    exposure: float | None = None,
    threads: int | None = None,
    progress: Callable[[float, float], object] | None = None,
) -> Picture:
    """Renders a picture of a scene. What is not given here the scene says, else the defaults hold: 128 samples a pixel,
    1280 x 720 pixels (one of width and height alone keeps the aspect ratio), paths of at most 100 scattering events, seed 0,
    the first camera, one thread a core. The same call gives the same numbers at any number of threads.

    `camera` is a name or a number from 0. `aovs` are names of `aovs()`, or "all". `time_limit` is in seconds of rendering.
    `exposure`, in stops, changes pictures to look at only. The other arguments are the options of `oscura render` of the same
    names.

    `progress(share, seconds)` is called several times a second in the calling thread: the share of samples taken, 0..1, and
    the time that rendering took so far. An exception in it stops rendering and is raised here, as is `KeyboardInterrupt` on
    Ctrl-C. Python's lock is free meanwhile.

    Raises `UsageError` for arguments that don't fit the scene and `InputError` for scenes that can't be rendered.
    """

@final
class Scene:
    """A scene: loaded by `load`, or built by the methods here. Raises `UsageError` for ids that don't exist."""

    def __new__(cls, name: str = "") -> Scene: ...
    @property
    def name(self) -> str: ...
    @property
    def warnings(self) -> list[str]:
        """What was ignored, approximated or repaired while it was loaded."""
    @property
    def notes(self) -> list[str]:
        """Choices that were made while it was loaded."""
    @property
    def cameras(self) -> list[str]:
        """Names of the cameras."""
    @property
    def materials(self) -> list[str]:
        """Names of the materials, by their ids."""
    @property
    def triangles(self) -> int:
        """How many triangles all placed meshes have."""
    def validate(self) -> None:
        """Raises `InputError` with everything that is wrong: impossible numbers and broken references."""
    def complete(
        self,
        *,
        stage: _Stage = "studio",
        ground: _Ground | None = None,
        background: Literal["transparent"] | _Vector | None = None,
        view_from: str | None = None,
        zoom: float = 1.0,
        fov: float = 30.0,
    ) -> None:
        """Adds what is missing, as `load` does: a camera that frames everything, light, a ground."""
    def add_texture(
        self,
        pixels: npt.ArrayLike,
        *,
        srgb: bool | None = None,
        wrap: Literal["repeat", "mirror", "clamp"] = "repeat",
        name: str = "texture",
    ) -> int:
        """A picture, H x W or H x W x C numbers, C from 1 to 4, rows from the top; returns its id. Bytes (uint8) are 0..1
        and sRGB unless `srgb` is False, as it must be for normals, roughness and metalness; floats are linear. Arrays of other
        numbers are refused: make them bytes, or floats of which 1 is white (`numpy.float32(pixels) / 255`)."""
    def add_pbr(
        self,
        name: str = "",
        *,
        base_color: _Vector = ...,
        base_color_texture: int | None = None,
        metallic: float = 0.0,
        roughness: float = 0.5,
        metallic_roughness_texture: int | None = None,
        normal_texture: int | None = None,
        normal_scale: float = 1.0,
        ior: float = 1.5,
        specular: float = 1.0,
        transmission: float = 0.0,
        thin: bool = False,
        attenuation_color: _Vector = ...,
        attenuation_distance: float = ...,
        clearcoat: float = 0.0,
        clearcoat_roughness: float = 0.0,
        sheen_color: _Vector = ...,
        sheen_roughness: float = 0.3,
        emission: _Vector | None = None,
        emission_texture: int | None = None,
        alpha: float = 1.0,
        alpha_mode: Literal["opaque", "mask", "blend"] | None = None,
        alpha_cutoff: float = 0.5,
        double_sided: bool = True,
        vertex_colors: bool = False,
    ) -> int:
        """The material of glTF 2.0 with its extensions; returns its id. Colours, `metallic`, `roughness`, `specular`,
        `transmission`, `clearcoat` and `alpha` are 0..1; `ior` at least 1. A texture is multiplied by the number beside it;
        roughness is its green, metalness its blue. `attenuation_distance` is in metres. `thin` makes a wall of what transmits
        light, in place of a solid. `emission` is radiance. `alpha` is multiplied by that of the base colour's texture;
        `alpha_mode` is "blend" where it is below 1, unless given."""
    def add_lambert(self, name: str = "", *, color: _Vector = ..., texture: int | None = None) -> int:
        """An ideally diffuse material of this reflectance, 0..1; returns its id."""
    def add_metal(
        self,
        name: str = "",
        *,
        color: _Vector | None = None,
        eta: _Vector | None = None,
        k: _Vector | None = None,
        roughness: float = 0.2,
    ) -> int:
        """A metal by its colour, or by its index of refraction `eta` and extinction `k`, each by channel; returns its
        id."""
    def add_glass(
        self,
        name: str = "",
        *,
        ior: float = 1.5,
        tint: _Vector = ...,
        roughness: float = 0.0,
        thin: bool = False,
    ) -> int:
        """Glass; `tint` is the factor on light at each crossing. Returns its id."""
    def add_emitter(self, name: str = "", *, radiance: _Vector, two_sided: bool = False) -> int:
        """A black surface that shines; returns its id."""
    def add_mesh(
        self,
        positions: npt.ArrayLike,
        triangles: npt.ArrayLike,
        material: int,
        *,
        normals: npt.ArrayLike | None = None,
        uvs: npt.ArrayLike | None = None,
        colors: npt.ArrayLike | None = None,
        name: str = "",
    ) -> int:
        """A mesh, which is seen where `add_instance` places it; returns its id. `positions` are N x 3 (stored as 32-bit
        floats), `triangles` M x 3 indices into them, counter-clockwise seen from their front. For each position: `normals`
        N x 3 of unit length, for smooth shading; `uvs` N x 2, v downwards; `colors` N x 3 or N x 4, linear, which materials
        with `vertex_colors` use."""
    def add_instance(
        self, mesh: int, transform: npt.ArrayLike | None = None, *, material: int | None = None, name: str = ""
    ) -> None:
        """Places a mesh: `transform` is a 3 x 4 or 4 x 4 matrix that is multiplied by columns (x, y, z, 1). `material`
        replaces those of the mesh."""
    def add_sphere(self, center: _Vector, radius: float, material: int, *, name: str = "") -> None: ...
    def add_disk(
        self, center: _Vector, normal: _Vector, radius: float, material: int, *, name: str = ""
    ) -> None:
        """A flat disk whose front faces `normal`, of any length but 0."""
    def add_quad(
        self, corner: _Vector, edge_u: _Vector, edge_v: _Vector, material: int, *, name: str = ""
    ) -> None:
        """A parallelogram; its front is on the side of the cross product of `edge_u` and `edge_v`."""
    def add_point_light(
        self, position: _Vector, intensity: _Vector, *, name: str = "", group: str = ""
    ) -> None:
        """A light without a size; `intensity` in W/sr. `group` is its group for `render(light_groups=True)`."""
    def add_spot_light(
        self,
        position: _Vector,
        direction: _Vector,
        intensity: _Vector,
        *,
        inner_angle: float = 0.0,
        outer_angle: float = 45.0,
        name: str = "",
        group: str = "",
    ) -> None:
        """A cone of light, `intensity` in W/sr on its axis; it fades from the inner to the outer half angle."""
    def add_sun(
        self, direction: _Vector, irradiance: _Vector, *, angle: float = 0.0, name: str = "", group: str = ""
    ) -> None:
        """Light from infinitely far that travels along `direction`; `irradiance` in W/m2 on surfaces that face it. `angle`
        is the sun's diameter as it is seen, 0 for parallel light."""
    def set_environment(
        self,
        *,
        color: _Vector | None = None,
        nadir: _Vector | None = None,
        zenith: _Vector | None = None,
        image: _Path | npt.NDArray[Any] | None = None,
        strength: float = 1.0,
        rotation: float = 0.0,
    ) -> None:
        """What is around everything: one radiance (`color`), a blend from straight down (`nadir`) to straight up
        (`zenith`), or an equirectangular picture: a file, or an array as of `add_texture`. Without any, black."""
    def add_camera(
        self,
        eye: _Vector,
        target: _Vector,
        *,
        fov: float | None = None,
        height: float | None = None,
        panorama: str | None = None,
        longitude: tuple[float, float] = ...,
        latitude: tuple[float, float] = ...,
        fisheye_lens: float = 10.5,
        sensor: tuple[float, float] = ...,
        up: _Vector = ...,
        focus: float | None = None,
        defocus: float = 0.0,
        aspect_ratio: float | None = None,
        name: str = "",
    ) -> None:
        """A camera at `eye` that looks at `target`; `fov` is its vertical angle of view (30 degrees). With `height`, metres, its
        rays are parallel and it sees so much. `panorama` is "equirectangular" with limits of `longitude` and `latitude` (degrees;
        0 is ahead; by default all around), "fisheye_equidistant" or "fisheye_equisolid", whose `fov` is the full angle of view (180);
        the latter has a focal length `fisheye_lens` and a `sensor`, width and height, millimetres. `defocus` is the angle of the lens's edge from a point in focus, `focus` the distance
        of the plane in focus (that of the target unless given)."""

@final
class Picture:
    """A rendered picture: a mapping from names of channels to arrays.

    `picture["color"]` is H x W x 4 32-bit floats: linear red, green, blue, premultiplied with alpha; rows from the top. AOVs
    have the names by which `render(aovs=...)` asked for them, groups of lights `RGBA_key`. Arrays are H x W x C; those of
    numbers of things ("object_id", "material_id", "samples") are uint32, all others float32. Each access makes a new array.
    """

    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    def keys(self) -> list[str]:
        """Names of the channels."""
    def components(self, name: str) -> list[str]:
        """The names that a channel's components have in EXR files, such as `N.X`."""
    def __getitem__(self, name: str, /) -> npt.NDArray[Any]: ...
    def __contains__(self, name: object, /) -> bool: ...
    def __len__(self) -> int: ...
    def __iter__(self) -> Iterator[str]: ...
    def rgba8(
        self,
        *,
        view: _View | None = None,
        exposure: float | None = None,
        white_balance: float | None = None,
        dither: bool = False,
    ) -> npt.NDArray[np.uint8]:
        """The picture as displays take it: H x W x 4 bytes with straight alpha. `exposure` in stops, `white_balance` in
        kelvin. Models on a stage have the filmic view unless another is given, all else "srgb"."""
    def save(
        self,
        path: _Path,
        *,
        float32: bool = False,
        view: _View | None = None,
        exposure: float | None = None,
        white_balance: float | None = None,
        dither: bool = False,
        deep: bool = False,
    ) -> list[str]:
        """Writes .exr, .png, .jpg, .tif, .webp or .hdr, whole or not at all; returns warnings about numbers that the file
        can't hold. EXRs have all channels, and colour as 16-bit floats unless `float32`; the other arguments are about pictures
        to look at. `deep`: 16 bits a channel, of PNG and TIFF. Raises `OutputError`."""
    @property
    def warnings(self) -> list[str]:
        """What was ignored, approximated or repaired on the way from the scene to the picture."""
    @property
    def statistics(self) -> dict[str, Any]:
        """What rendering took: `render_s`, `rays`, `samples_per_pixel`, `invalid_samples`, `timed_out`."""
    def _repr_png_(self) -> bytes: ...
