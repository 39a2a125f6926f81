#!/usr/bin/env python3
"""Mutation score of math/, quality/ and refinement/: small faults are put into their headers, one at a time, and the unit
tests of the folder must notice.

A mutant exchanges an operator, a comparison (< by <= of whole numbers, by >= of real ones), true and false, minimum and maximum,
the direction of a count, or leaves out one side of a logical operation. All mutants drawn are compiled into the tests at once, each behind a switch that the environment
turns on, so that a mutant costs one run of the tests and no compilation. A mutant is killed when a test fails, crashes or
does not end; it survives when all tests pass. Mutants that do not compile say nothing about the tests: more are drawn than
asked for, and the first ones that compile count. Exit code 1 if less than 90 % are killed.
Needs g++ (or $CXX; $CMAKE_CXX_COMPILER_LAUNCHER, e.g. ccache, is put before it), doctest, Eigen, OpenCV, yaml-cpp.
"""
import argparse
import concurrent.futures
import math
import os
import pathlib
import random
import re
import resource
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
INCLUDE = ROOT / "include"
FOLDERS = {"math": ["math", "evaluation"], "quality": ["quality"], "refinement": ["refinement"]}  # and where their tests are
LEAST = 90  # per cent
SPARE = 1.4  # mutants drawn for each that is wanted
ENDLESS = 3  # times the processor time of the tests without a mutant: an endless loop
ASLEEP = 5  # times that limit in wall time: tests that wait for ever use no processor
LEAST_SECONDS = 10  # of processor time, however quick the tests are
SLOW_SECONDS = 1  # a test that takes longer is run when all others have passed
MEMORY = 6 << 30  # bytes
# what the operators become: a type of SWITCHES, written between the operator and a second one
BINARY = {"<": "lt", "<=": "le", ">": "gt", ">=": "ge", "==": "eq", "!=": "ne", "+": "add", "-": "sub", "*": "mul", "/": "div"}
COMPOUND = {"+=": "negate", "-=": "negate", "*=": "invert", "/=": "invert"}
# clang-format puts blanks around binary operators and none around template brackets, references and pointers
PLACE = re.compile(r"(?<= )(?P<binary><=|>=|==|!=|<|>|\+|-|\*|/)(?= \S)|(?<= )(?P<compound>\+=|-=|\*=|/=)(?= \S)"
                   r"|(?<= )(?P<logical>&&|\|\|)(?= \S)|(?<![\w:])(?P<truth>true|false)(?!\w)"
                   r"|(?P<extreme>std::min|std::max)(?=\()|\+\+(?P<count>\w+)(?=[);,]|$)")
# what tells the user, and what only the compiler sees: no test of behaviour is to know it
NO_CODE = re.compile(r"^\s*(#|//|/\*|\*|template\b|using\b|static_assert\b|v\(\"|class = |inline constexpr|static constexpr|constexpr)"
                     r"|APSO_NAMESPACE|operator|expects\(|enable_if|_v<")
SWITCHES = """// Switches of the mutants; made by scripts/mutate.py.
#pragma once
#include <algorithm>
#include <cstdlib>
#include <initializer_list>
#include <type_traits>
namespace apso_mutate {
inline const int active = std::getenv("APSO_MUTANT") != nullptr ? std::atoi(std::getenv("APSO_MUTANT")) : -1;
constexpr bool on(int id) { return __builtin_is_constant_evaluated() ? false : active == id; }
// a < lt<id>{} < b is a < b, or a <= b for the mutant
#define APSO_MUTANT_OF(NAME, OP, OTHER, REAL_OTHER)                                                                  \\
  template <int id> struct NAME {};                                                                                  \\
  template <int id, class T> struct NAME##_left { const T& a; };                                                     \\
  template <class T, int id> constexpr NAME##_left<id, T> operator OP(const T& a, NAME<id>) { return {a}; }          \\
  template <int id, class T, class U> constexpr auto operator OP(NAME##_left<id, T> l, const U& b)->decltype(l.a OP b) { \\
    if (on(id)) {                                                                                                    \\
      if constexpr (std::is_integral_v<T> && std::is_integral_v<U>) return l.a OTHER b;                              \\
      else return l.a REAL_OTHER b;                                                                                  \\
    }                                                                                                                \\
    return l.a OP b;                                                                                                 \\
  }
// real numbers are hardly ever equal, so that a bound that belongs to the other side is no fault of theirs
APSO_MUTANT_OF(lt, <, <=, >=) APSO_MUTANT_OF(le, <=, <, >) APSO_MUTANT_OF(gt, >, >=, <=) APSO_MUTANT_OF(ge, >=, >, <)
APSO_MUTANT_OF(eq, ==, !=, !=) APSO_MUTANT_OF(ne, !=, ==, ==)
APSO_MUTANT_OF(add, +, -, -) APSO_MUTANT_OF(sub, -, +, +) APSO_MUTANT_OF(mul, *, /, /) APSO_MUTANT_OF(div, /, *, *)
// a += negate<id>{} = b
template <int id> struct negate {
  template <class T> constexpr T operator=(const T& b) const { return on(id) ? static_cast<T>(-b) : b; }
};
template <int id> struct invert {
  template <class T, class = std::enable_if_t<!std::is_integral_v<T>>> constexpr T operator=(const T& b) const { return on(id) ? T(1) / b : b; }
};
template <int id, bool smaller, class T> constexpr const T& extreme(const T& a, const T& b) {
  return smaller != on(id) ? std::min(a, b) : std::max(a, b);
}
template <int id, bool smaller, class T> constexpr T extreme(std::initializer_list<T> all) {
  return smaller != on(id) ? std::min(all) : std::max(all);
}
template <int id, class T> constexpr void count(T& n) {
  if (on(id)) --n;
  else ++n;
}
}  // namespace apso_mutate
"""


class Mutant:
    """One fault at one place of a header."""

    def __init__(self, header, line, match):
        self.header, self.line, self.column = header, line, match.start()
        self.kind, self.old = match.lastgroup, match.group(match.lastgroup)
        self.end = match.end()
        self.number = -1
        self.text = header.read_text().splitlines()[line].strip()

    def place(self):
        return f"{self.header.relative_to(INCLUDE)}:{self.line + 1}:{self.column + 1}"

    def __str__(self):
        other = {"<": "<= or >=", "<=": "< or >", ">": ">= or <=", ">=": "> or <", "==": "!=", "!=": "==", "true": "false", "false": "true", "+": "-",
                 "-": "+", "*": "/", "/": "*", "+=": "-=", "-=": "+=", "*=": "/=", "/=": "*=", "std::min": "std::max",
                 "std::max": "std::min", "&&": "left side alone", "||": "left side alone"}
        return f"{self.place()}: {self.old} -> {'--' if self.kind == 'count' else other[self.old]}: {self.text}"

    def switched(self, line):
        """The line with the mutant behind its switch."""
        n, before, after = self.number, line[:self.column], line[self.end:]
        if self.kind == "binary":
            return f"{before}{self.old} ::apso_mutate::{BINARY[self.old]}<{n}>{{}} {self.old}{after}"
        if self.kind == "compound":
            return f"{before}{self.old} ::apso_mutate::{COMPOUND[self.old]}<{n}>{{}} ={after}"
        if self.kind == "truth":
            return f"{before}({'!' if self.old == 'true' else ''}::apso_mutate::on({n})){after}"
        if self.kind == "extreme":
            return f"{before}::apso_mutate::extreme<{n}, {'true' if self.old == 'std::min' else 'false'}>{after}"
        if self.kind == "count":
            return f"{before}::apso_mutate::count<{n}>({self.old}){after}"
        depth, stop = 0, len(after)  # the right side ends with a bracket, a weaker operator or the statement
        for i, c in enumerate(after):
            depth += (c in "([{") - (c in ")]}")
            weaker = after[i:i + 2] in ("||", "&&") if self.old == "&&" else after[i:i + 2] == "||"
            if depth < 0 or depth == 0 and (c in ";,?" or weaker or c == ":" and ":" not in after[i - 1] + after[i + 1:i + 2]):
                stop = i
                break
        guard = f"::apso_mutate::on({n}) ||" if self.old == "&&" else f"!::apso_mutate::on({n}) &&"
        return f"{before}{self.old} ({guard} ({after[:stop].strip()})) {after[stop:]}"


def mutants_of(header):
    found = []
    for number, line in enumerate(header.read_text().splitlines()):
        if NO_CODE.search(line):
            continue
        code = re.sub(r'"(\\.|[^"\\])*"', lambda m: "_" * len(m.group()), line).split("//")[0]
        found += [Mutant(header, number, m) for m in PLACE.finditer(code)]
    return found


class Tests:
    """The tests of one folder, built with all mutants in place and switched off."""

    def __init__(self, folder, mutants, scratch):
        self.mutants, self.folder, self.scratch = mutants, folder, scratch / folder
        self.overlay = self.scratch / "include"
        self.scratch.mkdir(parents=True, exist_ok=True)
        for number, m in enumerate(mutants):
            m.number = number
        self.sources = sorted(s for f in FOLDERS[folder] for s in (ROOT / "tests" / f).glob("test_*.cpp"))
        flags = subprocess.run(["pkg-config", "--cflags", "eigen3", "opencv4"], check=True, capture_output=True, text=True).stdout
        self.linker = os.environ.get("CXX", "g++")
        self.plain = [self.linker, "-std=c++17", "-O1", "-w", "-I" + str(self.overlay), "-I" + str(INCLUDE),
                      f'-DAPSO_SOURCE_DIR="{ROOT}"', *flags.split()]
        self.compiler = [*os.environ.get("CMAKE_CXX_COMPILER_LAUNCHER", "").split(), *self.plain]

    def write_headers(self):
        shutil.rmtree(self.overlay, ignore_errors=True)
        self.overlay.mkdir()
        (self.overlay / "apso_mutate.hpp").write_text(SWITCHES)
        for header in {m.header for m in self.mutants}:
            lines = header.read_text().splitlines()
            here = [m for m in self.mutants if m.header == header]
            for m in sorted(here, key=lambda m: (m.line, -m.column)):  # from the right, so that columns stay
                lines[m.line] = m.switched(lines[m.line])
            copy = self.overlay / header.relative_to(INCLUDE)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_text("\n".join(lines) + "\n")

    def compile(self, source):
        """Leaves out the mutants that do not compile. \\returns the object file"""
        made = self.scratch / (source.stem + ".o")
        while True:
            done = subprocess.run([*self.compiler, "-include", "apso_mutate.hpp", "-c", source, "-o", made], capture_output=True, text=True)
            if done.returncode == 0:
                return made
            # ccache writes paths relative to the current folder
            lines = {(pathlib.Path(p).resolve(), int(n)) for p, n in re.findall(r"([^\s:]+\.hpp):(\d+)", done.stderr)}
            wrong = [m for m in self.mutants if (self.overlay / m.header.relative_to(INCLUDE), m.line + 1) in lines]
            if not wrong:
                sys.exit(f"{source}: does not compile:\n{done.stderr[:3000]}")
            for m in wrong:
                print(f"  not compiled: {m}", flush=True)
            self.mutants = [m for m in self.mutants if m not in wrong]
            self.write_headers()

    def leave_out_unseen(self):
        """Leaves out the mutants that the preprocessor removes, of code for another compiler."""
        seen = set()
        for source in self.sources:
            text = subprocess.run([*self.plain, "-include", "apso_mutate.hpp", "-E", source], check=True,
                                  capture_output=True, text=True).stdout
            seen |= {int(n) for n in re.findall(r"apso_mutate::(?:\w+<|on\()(\d+)", text)}
        self.mutants = [m for m in self.mutants if m.number in seen]

    def build(self):
        self.write_headers()
        self.leave_out_unseen()
        main = self.scratch / "main.o"
        subprocess.run([*self.compiler, "-c", ROOT / "tests" / "main.cpp", "-o", main], check=True)
        objects = [self.compile(s) for s in self.sources]
        self.program = self.scratch / "tests"
        subprocess.run([self.linker, *objects, main, "-o", self.program, "-pthread", "-lopencv_core", "-lopencv_imgproc", "-lyaml-cpp"],
                       check=True)
        self.cpu_seconds, self.slow = 3600, ""
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        if self.run(-1) != "":
            sys.exit(f"{self.folder}: the tests fail without any mutant")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        self.cpu_seconds = math.ceil(max(LEAST_SECONDS, ENDLESS * used))
        times = re.findall(r"^([0-9.]+) s: (.*)$", self.start(-1, "--duration=true").stdout, re.M)
        self.slow = ",".join(name.replace(",", "?") for seconds, name in times if float(seconds) > SLOW_SECONDS)
        print(f"  tests without a mutant: {used:.1f} s; a mutant has {self.cpu_seconds} s", flush=True)

    def start(self, number, *options):
        """The tests with one mutant, ended; raises TimeoutExpired."""
        def limits():
            resource.setrlimit(resource.RLIMIT_CPU, (self.cpu_seconds, self.cpu_seconds + 5))
            resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        return subprocess.run([self.program, "--abort-after=1", "--no-colors", *options], env={**os.environ, "APSO_MUTANT": str(number)},
                              preexec_fn=limits, capture_output=True, text=True, errors="replace", timeout=ASLEEP * self.cpu_seconds)

    def run(self, number):
        """What killed the mutant; empty if nothing did. Slow tests come last."""
        for options in [[f"--test-case-exclude={self.slow}"], [f"--test-case={self.slow}"]] if self.slow else [[]]:
            try:
                done = self.start(number, *options)
            except subprocess.TimeoutExpired:
                return "no end"
            if done.returncode != 0:
                named = re.search(r"TEST CASE: +(.*)", done.stdout)
                return named.group(1)[:70] if named else f"no end or a crash ({done.returncode})"
        return ""


def interval(killed, n):
    """95 % interval of a share (Wilson), in per cent."""
    z, p = 1.96, killed / n
    centre = (p + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * math.sqrt(p * (1 - p) / n + z * z / (4 * n * n))
    return 100 * (centre - half), 100 * (centre + half)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sample", type=int, default=120, help="mutants, over all folders (default %(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the sample (default %(default)s)")
    parser.add_argument("--folder", action="append", choices=list(FOLDERS), help="only this folder (may be given again)")
    parser.add_argument("--jobs", type=int, default=1, help="mutants at a time (default %(default)s)")
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build-mutants", help="folder for what is compiled")
    parser.add_argument("--list", action="store_true", help="print the mutants that are drawn, and try none")
    arguments = parser.parse_args()
    folders = arguments.folder or FOLDERS
    survivors, killed, total = [], 0, 0
    for k, folder in enumerate(folders):
        wanted = arguments.sample * (k + 1) // len(folders) - arguments.sample * k // len(folders)
        possible = [m for h in sorted((INCLUDE / "apso" / folder).rglob("*.hpp")) for m in mutants_of(h)]
        drawn = random.Random(f"{arguments.seed} {folder}").sample(possible, min(len(possible), math.ceil(wanted * SPARE)))
        print(f"{folder}: {wanted} of {len(possible)} mutants", flush=True)
        if arguments.list:
            print("\n".join(f"  {m}" for m in drawn))
            continue
        tests = Tests(folder, drawn, arguments.build.resolve())
        tests.build()
        tried = tests.mutants[:wanted]
        with concurrent.futures.ThreadPoolExecutor(arguments.jobs) as pool:
            for m, by in zip(tried, pool.map(lambda m: tests.run(m.number), tried)):
                print(f"  {'killed' if by else 'SURVIVED'}: {m}{'  by: ' + by if by else ''}", flush=True)
                total += 1
                if by:
                    killed += 1
                else:
                    survivors.append(str(m))
    if arguments.list:
        return 0
    print("survivors:" if survivors else "no survivors")
    print("\n".join("  " + s for s in survivors))
    low, high = interval(killed, total)
    print(f"{killed} of {total} mutants killed: {100 * killed / total:.0f} % (95 % interval {low:.0f} to {high:.0f} %), seed {arguments.seed}")
    return 0 if killed >= LEAST / 100 * total else 1


if __name__ == "__main__":
    sys.exit(main())
