# The few names of Conan 2 that packaging/conan/conanfile.py uses, so that the recipe can be run where Conan is not
# installed (Debian has no package of it).


class ConanFile:
    def __init__(self):
        self.required = []
        self.cpp_info = _CppInfo()

    def requires(self, reference, **traits):
        self.required.append(reference)


class _CppInfo:
    def __init__(self):
        self.properties = {}

    def set_property(self, name, value):
        self.properties[name] = value
