"""Packs the folders of the source tree into one package, and builds the libraries of kernels, which are no extension
modules of Python but are packaged as such.

A wheel has a library for each level of processors; `build_ext --inplace` and an editable install make that of this
machine, in the source tree.
"""

import os
import sys
from pathlib import Path

from setuptools import Extension, find_packages, setup
from setuptools.command.build_ext import build_ext
from setuptools.command.build_py import build_py
from setuptools.errors import LinkError, PlatformError

ROOT = Path(__file__).resolve().parent
FOLDERS = ("ao", "raytrace", "scenes")
LIBRARIES = ["m"] if os.name == "posix" else []


class BuildPackage(build_py):
    """Copies the modules, `cli.py` from beside the package's folder."""

    def find_modules(self) -> list[tuple[str, str, str]]:
        return [("obscurance", "cli", "cli.py")]


class BuildKernels(build_ext):
    """Compiles the kernels by Numba, and links them by the platform's linker."""

    def run(self) -> None:
        sys.path.insert(0, str(ROOT))
        from obscurance.raytrace.kernel import build, library, processor

        in_tree = self.inplace or self.editable_mode
        levels = (processor.level(),) if in_tree else processor.levels()
        folder = ROOT if in_tree else Path(self.build_lib) / "obscurance"
        objects = build.objects(ROOT / "build" / "kernels", levels, _show)
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
    parts = find_packages(str(ROOT), include=[pattern for folder in FOLDERS for pattern in (folder, f"{folder}.*")])
    setup(
        packages=["obscurance", *(f"obscurance.{part}" for part in parts)],
        package_dir={f"obscurance.{folder}": folder for folder in FOLDERS},
        py_modules=["obscurance.cli"],
        ext_modules=[Extension("obscurance.raytrace.kernel.kernels", [])],
        cmdclass={"build_py": BuildPackage, "build_ext": BuildKernels},
    )
