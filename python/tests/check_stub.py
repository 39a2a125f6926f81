"""Checks that a stub names exactly the public classes, functions, arguments and properties of apso.  usage: check_stub.py FILE.pyi"""
import ast
import pathlib
import re
import sys

import apso

tree = ast.parse(pathlib.Path(sys.argv[1]).read_text())
errors = []


def arguments(node):
    a = node.args
    return [x.arg for x in a.args + a.kwonlyargs if x.arg != "self"]


def documented(function):
    """Names of the arguments in the signature that pybind11 writes."""
    signature = function.__doc__.split(") -> ")[0]
    return [x for x in re.findall(r"[(,] ?(\w+): ", re.sub(r"(Tuple|tuple)\[[^]]*\]", "tuple", signature)) if x != "self"]


def compare(name, stub, real):
    if stub != real:
        errors.append(f"{name}: the stub has {stub}, the module has {real}")


public = {x for x in apso.__all__ if x != "__version__"}
compare("apso", sorted(n.name for n in tree.body if isinstance(n, (ast.ClassDef, ast.FunctionDef))), sorted(public))
for node in tree.body:
    if isinstance(node, ast.FunctionDef):
        compare(node.name, arguments(node), documented(getattr(apso, node.name)))
    elif isinstance(node, ast.ClassDef):
        real = getattr(apso, node.name)
        members = {n for n in vars(real) if not n.startswith("_")}
        compare(node.name, sorted(m.name for m in node.body if m.name != "__init__"), sorted(members))
        for m in node.body:
            if not m.decorator_list:
                compare(f"{node.name}.{m.name}", arguments(m), documented(getattr(real, m.name)))
print("\n".join(errors) or f"{len(tree.body)} declarations agree")
sys.exit(1 if errors else 0)
