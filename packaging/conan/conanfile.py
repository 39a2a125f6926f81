# conan create packaging/conan    (run in a checkout or an unpacked release; Conan 2)
import os
import re

from conan import ConanFile
from conan.tools.files import copy, load


class ApsoConan(ConanFile):
    name = "apso"
    license = "MIT"
    description = "RGB-D SLAM that stays reliable where people and things move"
    topics = ("slam", "rgb-d", "header-only")
    package_type = "header-library"
    no_copy_source = True

    def set_version(self):
        header = load(self, os.path.join(self.recipe_folder, "..", "..", "include", "apso", "version.hpp"))
        self.version = re.search(r'#define APSO_VERSION "([0-9.]+)"', header).group(1)

    def export_sources(self):
        root = os.path.join(self.recipe_folder, "..", "..")
        copy(self, "LICENSE", root, self.export_sources_folder)
        copy(self, "include/*.hpp", root, self.export_sources_folder)

    def requirements(self):
        self.requires("eigen/3.4.0", transitive_headers=True)

    def package_id(self):
        self.info.clear()

    def package(self):
        copy(self, "LICENSE", self.source_folder, os.path.join(self.package_folder, "licenses"))
        copy(self, "*.hpp", os.path.join(self.source_folder, "include"), os.path.join(self.package_folder, "include"))

    def package_info(self):
        self.cpp_info.bindirs = []
        self.cpp_info.libdirs = []
        self.cpp_info.set_property("cmake_file_name", "apso")
        self.cpp_info.set_property("cmake_target_name", "apso::apso")
        self.cpp_info.set_property("pkg_config_name", "apso")
