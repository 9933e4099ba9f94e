"""Conan recipe: conan create . --no-remote (docs/embedding.md)."""
import os
import re

from conan import ConanFile
from conan.tools.cmake import CMake, CMakeToolchain, cmake_layout
from conan.tools.files import copy, load


class Cairn(ConanFile):
    name = "cairn"
    license = "BSD-3-Clause"
    description = "Maps from range scans and contours of objects, freestanding C11 on memory pools"
    topics = ("slam", "robotics", "embedded", "contours")
    package_type = "static-library"
    settings = "os", "compiler", "build_type", "arch"
    options = {"host": [True, False], "fPIC": [True, False]}
    # The host library takes zlib, libyaml and others from the system.
    default_options = {"host": False, "fPIC": True}
    exports_sources = ("CMakeLists.txt", "LICENSE", "include/*", "src/*", "packaging/cmake/*", "tools/page.sh",
                       "tools/modules.txt")

    def set_version(self):
        text = load(self, os.path.join(self.recipe_folder, "include", "cairn", "version.h"))
        self.version = re.search(r'CAIRN_VERSION_STRING "(.*)"', text).group(1)

    def export(self):
        copy(self, "include/cairn/version.h", self.recipe_folder, self.export_folder)

    def configure(self):
        self.settings.rm_safe("compiler.libcxx")
        self.settings.rm_safe("compiler.cppstd")

    def layout(self):
        cmake_layout(self)

    def generate(self):
        toolchain = CMakeToolchain(self)
        toolchain.cache_variables["CAIRN_HOST"] = bool(self.options.host)
        toolchain.generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def package(self):
        copy(self, "LICENSE", self.source_folder, os.path.join(self.package_folder, "licenses"))
        CMake(self).install()

    def package_info(self):
        self.cpp_info.set_property("cmake_file_name", "cairn")
        # The target of all components would be cairn::cairn, too; float and double in one program do not link.
        self.cpp_info.set_property("cmake_target_name", "cairn::all_components")
        self._component("cairn", "cairn")
        self._component("float", "cairn-float").defines = ["CAIRN_FLOAT"]
        if self.options.host:
            self._component("host", "cairn-host").requires = ["cairn"]

    def _component(self, name, library):
        component = self.cpp_info.components[name]
        component.set_property("cmake_target_name", "cairn::" + name)
        component.libs = [library]
        if self.settings.os in ("Linux", "FreeBSD"):
            component.system_libs = ["m"]
        return component
