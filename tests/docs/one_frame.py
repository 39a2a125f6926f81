#!/usr/bin/env python3
"""docs/one_frame.md is what the program prints: the same words, and numbers that differ by rounding between compilers at most.
usage: one_frame.py PROGRAM PAGE"""
import re
import subprocess
import sys

NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
program, page = sys.argv[1:]
run = subprocess.run([program], capture_output=True, text=True)
if run.returncode != 0:
    sys.exit(f"{program} ended with {run.returncode}:\n{run.stderr}")
with open(page, encoding="utf-8") as stream:
    written = stream.read()


def words(text):
    return re.sub(r"\s+", " ", NUMBER.sub("#", text).replace("+#", "#"))


old, new = NUMBER.findall(written), NUMBER.findall(run.stdout)
problems = []
if words(written) != words(run.stdout):
    problems.append("the words differ")
for a, b in zip(old, new):
    last_digit = 10.0 ** -len(a.partition(".")[2])
    if abs(float(a) - float(b)) > max(2.5 * last_digit, 0.05 * abs(float(a))):
        problems.append(f"{a} on the page, {b} now")
if problems:
    sys.exit("docs/one_frame.md is out of date: " + "; ".join(problems[:10]) + f"\nwrite it again: {program} > docs/one_frame.md")
