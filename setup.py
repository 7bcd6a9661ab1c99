"""Builds the libraries of kernels, which are no extension modules of Python but stand beside one another as such.

A wheel has one for each level of processors; `build_ext --inplace`, for the source tree, makes that of this machine.
"""

import os
import sys
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

ROOT = Path(__file__).resolve().parent


class BuildKernels(build_ext):
    """Compiles the kernels by Numba, and links them by the platform's linker."""

    def run(self) -> None:
        if self.editable_mode:
            return  # the source tree's is made by `make install`, which shows how far that is
        from distutils.ccompiler import new_compiler
        from distutils.sysconfig import customize_compiler

        sys.path.insert(0, str(ROOT))
        from raytrace.kernel import build, library

        levels = (library.level(),) if self.inplace else library.levels()
        made = build.objects(Path(self.build_temp).resolve(), levels, _show)
        linker = new_compiler(compiler=self.compiler)
        customize_compiler(linker)
        folder = ROOT if self.inplace else Path(self.build_lib)
        for level, objects in made.items():
            target = folder / library.file_of(level).relative_to(ROOT)
            linker.link_shared_object([*map(str, objects)], str(target), libraries=["m"] if os.name == "posix" else [], export_symbols=build.exported())


def _show(done: int, total: int) -> None:
    if sys.stderr.isatty():
        print(f"\rkernels: {done} of {total} built", end="\n" if done == total else "", file=sys.stderr, flush=True)
    elif done == total:
        print(f"kernels: {total} built", file=sys.stderr)


if __name__ == "__main__":
    setup(ext_modules=[Extension("raytrace.kernel.kernels", [])], cmdclass={"build_ext": BuildKernels})
