"""Physically correct pictures of 3D scenes, on the CPU. `_oscura.pyi` has the documentation."""

from ._oscura import (
    Error,
    InputError,
    OutputError,
    Picture,
    Scene,
    UsageError,
    __version__,
    aovs,
    load,
    render,
)

__all__ = [
    "Error",
    "InputError",
    "OutputError",
    "Picture",
    "Scene",
    "UsageError",
    "__version__",
    "aovs",
    "load",
    "render",
]
