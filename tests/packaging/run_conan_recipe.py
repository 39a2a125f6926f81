"""Runs the steps of the recipe in Conan's order. usage: run_conan_recipe.py RECIPE_FOLDER SCRATCH VERSION"""
import importlib.util
import os
import sys

sys.dont_write_bytecode = True
here = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(here, "conan_stand_in"))
recipe_folder, scratch, version = sys.argv[1:4]
spec = importlib.util.spec_from_file_location("recipe", os.path.join(recipe_folder, "conanfile.py"))
module = importlib.util.module_from_spec(spec)
spec.loader.exec_module(module)

recipe = module.ApsoConan()
recipe.recipe_folder = recipe_folder
recipe.set_version()
assert recipe.version == version, f"the recipe says {recipe.version}, the headers {version}"
recipe.export_sources_folder = recipe.source_folder = os.path.join(scratch, "export")
recipe.package_folder = os.path.join(scratch, "package")
recipe.export_sources()
recipe.requirements()
recipe.package()
recipe.package_info()
assert recipe.required == ["eigen/3.4.0"], recipe.required
assert recipe.cpp_info.properties["cmake_target_name"] == "apso::apso"
assert os.path.exists(os.path.join(recipe.package_folder, "licenses", "LICENSE"))
