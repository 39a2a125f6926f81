"""Builds the Python package: `pip install .`. What is compiled is described in python/CMakeLists.txt."""
import os
import pathlib
import re
import subprocess
import sys

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

ROOT = pathlib.Path(__file__).parent.resolve()
VERSION = re.search(r'#define APSO_VERSION "([0-9.]+)"', (ROOT / "include/apso/version.hpp").read_text()).group(1)


# Outside of build/, which is that of the C++ project.
WORK = pathlib.Path(os.environ.get("APSO_PYTHON_BUILD", ROOT / "build-python"))
WORK.mkdir(parents=True, exist_ok=True)


class CMakeBuild(build_ext):
    def build_extension(self, extension):
        import pybind11  # here, so that the version can be asked for without it

        target = pathlib.Path(self.get_ext_fullpath(extension.name)).parent.resolve()
        work = pathlib.Path(self.build_temp).resolve() / "cmake"
        work.mkdir(parents=True, exist_ok=True)
        configure = ["cmake", "-S", str(ROOT / "python"), "-B", str(work), "-DCMAKE_BUILD_TYPE=Release",
                     f"-DCMAKE_LIBRARY_OUTPUT_DIRECTORY={target}", f"-Dpybind11_DIR={pybind11.get_cmake_dir()}",
                     f"-DPYTHON_EXECUTABLE={sys.executable}"]
        subprocess.run(configure + os.environ.get("CMAKE_ARGS", "").split(), check=True)
        subprocess.run(["cmake", "--build", str(work), "--target", "_apso", "--parallel", str(os.cpu_count() or 1)], check=True)


setup(
    name="apso",
    version=VERSION,
    description="Direct RGB-D alignment, frame quality and trajectory evaluation for scenes where people and things move",
    license="MIT",
    python_requires=">=3.8",
    install_requires=["numpy"],
    packages=["apso"],
    package_dir={"apso": "python/apso"},
    package_data={"apso": ["py.typed", "*.pyi"]},
    ext_modules=[Extension("apso._apso", sources=[])],
    cmdclass={"build_ext": CMakeBuild},
    zip_safe=False,
    options={"build": {"build_base": str(WORK)}, "egg_info": {"egg_base": str(WORK)}},
)
