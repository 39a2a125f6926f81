import fnmatch
import os
import shutil


def load(conanfile, path):
    with open(path) as file:
        return file.read()


def copy(conanfile, pattern, src, dst):
    """As Conan: the pattern is matched against the path relative to src, and * also matches slashes."""
    copied = []
    for folder, _, names in os.walk(src):
        for name in names:
            relative = os.path.relpath(os.path.join(folder, name), src)
            if fnmatch.fnmatch(relative, pattern):
                target = os.path.join(dst, relative)
                os.makedirs(os.path.dirname(target), exist_ok=True)
                shutil.copy(os.path.join(src, relative), target)
                copied.append(target)
    return copied
