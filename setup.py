"""Builds the libraries of kernels, which are no extension modules of Python but are packaged as such.

A wheel has one for each level of processors; `build_ext --inplace`, for the source tree, makes that of this machine.
"""

import os
import sys
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext
from setuptools.errors import LinkError, PlatformError

ROOT = Path(__file__).resolve().parent
LIBRARIES = ["m"] if os.name == "posix" else []


class BuildKernels(build_ext):
    """Compiles the kernels by Numba, and links them by the platform's linker."""

    def run(self) -> None:
        if self.editable_mode:
            return  # the source tree's is made by `make install`, which shows how far that is
        sys.path.insert(0, str(ROOT))
        from obscurance.raytrace.kernel import build, library

        levels = (library.level(),) if self.inplace else library.levels()
        folder = ROOT if self.inplace else Path(self.build_lib)
        objects = build.objects(Path(self.build_temp).resolve(), levels, _show)
        for level, files in objects.files.items():
            target = folder / library.file_of(level).relative_to(ROOT)
            self._link(list(map(str, files)), str(target), objects.names)

    def _link(self, objects: list[str], target: str, names: list[str]) -> None:
        from distutils.ccompiler import new_compiler
        from distutils.sysconfig import customize_compiler

        linker = new_compiler(compiler=self.compiler)
        customize_compiler(linker)
        try:
            linker.link_shared_object(objects, target, libraries=LIBRARIES, export_symbols=names)
        except (LinkError, PlatformError) as failure:
            raise SystemExit(f"kernels: expected a linker, such as gcc's, clang's or MSVC's, got: {failure}") from None


def _show(done: int, total: int) -> None:
    if sys.stderr.isatty():
        print(f"\rkernels: {done} of {total} built", end="\n" if done == total else "", file=sys.stderr, flush=True)
    elif done == total:
        print(f"kernels: {total} built", file=sys.stderr)


if __name__ == "__main__":
    setup(ext_modules=[Extension("obscurance.raytrace.kernel.kernels", [])], cmdclass={"build_ext": BuildKernels})
