"""Embree's C library: its functions, its one device, its errors.

The only importer of embreex. Its extension module is linked to the Embree it ships, so opening that module with ctypes
resolves Embree's whole C API without guessing where a wheel keeps the library; to import it would bring Python's
logging, and take as long as to open it. Kernels get the addresses by name.
"""

import ctypes
import sys
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from ..errors import EmbreeError
from ..kernel.library import provide

try:
    import embreex
except ImportError as failure:
    raise EmbreeError(
        f"embreex, which brings Embree, cannot be imported ({failure}): `python -m pip install embreex` installs it on "
        "x86-64 Linux with glibc, macOS 13 or later, and x86-64 Windows; elsewhere, as on ARM Linux, it has no wheel: "
        "build the Dockerfile's image with --platform linux/amd64 and run that"
    ) from failure

_VERSION_PROPERTY = 0

_Pointer, _Size, _Int = ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int
_SIGNATURES: dict[str, tuple[Any, list[Any]]] = {
    "rtcNewDevice": (_Pointer, [ctypes.c_char_p]),
    "rtcGetDeviceProperty": (ctypes.c_ssize_t, [_Pointer, _Int]),
    "rtcGetDeviceError": (_Int, [_Pointer]),
    "rtcGetDeviceLastErrorMessage": (ctypes.c_char_p, [_Pointer]),
    "rtcNewScene": (_Pointer, [_Pointer]),
    "rtcSetSceneFlags": (None, [_Pointer, _Int]),
    "rtcCommitScene": (None, [_Pointer]),
    "rtcReleaseScene": (None, [_Pointer]),
    "rtcNewGeometry": (_Pointer, [_Pointer, _Int]),
    "rtcSetSharedGeometryBuffer": (None, [_Pointer, _Int, ctypes.c_uint, _Int, _Pointer, _Size, _Size, _Size]),
    "rtcCommitGeometry": (None, [_Pointer]),
    "rtcReleaseGeometry": (None, [_Pointer]),
    "rtcAttachGeometryByID": (None, [_Pointer, _Pointer, ctypes.c_uint]),
    "rtcSetGeometryInstancedScene": (None, [_Pointer, _Pointer]),
    "rtcSetGeometryTransform": (None, [_Pointer, ctypes.c_uint, _Int, _Pointer]),
}
_QUERIES = ("rtcIntersect8", "rtcOccluded8", "rtcIntersect16", "rtcOccluded16", "rtcPointQuery")


def _open_library() -> ctypes.CDLL:
    """Load embreex's Embree with the types of its C functions, and hand queries to kernels. Raises: EmbreeError."""
    if sys.platform == "win32":
        import_module("embreex.rtcore_scene")  # which loads it
        library = ctypes.CDLL("embree4.dll")
    else:
        library = ctypes.CDLL(str(next(Path(embreex.__path__[0]).glob("rtcore_scene.*.so"))))
    try:
        for name, (result, arguments) in _SIGNATURES.items():
            function = getattr(library, name)
            function.restype, function.argtypes = result, arguments
        for name in _QUERIES:
            provide(name, ctypes.cast(getattr(library, name), _Pointer).value or 0)
    except AttributeError as missing:
        raise EmbreeError(f"embreex: Embree library: expected version 4 with all of its C API, got {missing}") from None
    return library


library = _open_library()


@cache
def device() -> int:
    """The process's one Embree device."""
    device = library.rtcNewDevice(None)
    if not device:
        raise EmbreeError(f"Embree device: {_last_message(None)}")
    check_version(library.rtcGetDeviceProperty(device, _VERSION_PROPERTY))
    return int(device)


def check_version(number: int) -> None:
    """Check that a version number, such as 40303, is of an Embree 4. Raises: EmbreeError."""
    if number // 10000 != 4:
        raise EmbreeError(f"embreex: Embree version: expected 4.x, got {number // 10000}.{number // 100 % 100}")


def version() -> str:
    """Embree's own version, such as '4.4.0'."""
    number = library.rtcGetDeviceProperty(device(), _VERSION_PROPERTY)
    return f"{number // 10000}.{number // 100 % 100}.{number % 100}"


def _last_message(device: int | None) -> str:
    """Embree's message about the last error of a device; of None, about the creation of a device."""
    text = library.rtcGetDeviceLastErrorMessage(device)
    return text.decode(errors="replace") if text else "unknown error"


def check(device: int) -> None:
    """Check that no call to Embree on this device has failed. Raises: EmbreeError."""
    if library.rtcGetDeviceError(device):
        raise EmbreeError(f"Embree: {_last_message(device)}")
