#!/usr/bin/env python3
"""Draws a run of a benchmark as bars, or two runs side by side with the ratio of their times.

    build/bin/bench_alignment --benchmark_format=json > new.json
    scripts/plot_benchmarks.py new.json --output alignment.svg
    scripts/plot_benchmarks.py old.json new.json --output both.svg

Of repetitions the fastest counts, which is disturbed least. Two runs are also printed as a table. Needs gnuplot.
"""
import argparse
import json
import math
import os
import subprocess
import sys

UNITS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}  # [s]
TERMINALS = {
    ".svg": "svg size 1000,{height} dynamic font 'sans,14' background rgb 'white'",
    ".png": "pngcairo size 1000,{height} font 'sans,10' background rgb 'white'",
    ".pdf": "pdfcairo size 9in,{inches:.2f}in font 'sans,10' background rgb 'white'",
}


def read(file):
    """The context of a run, and the CPU time [us] of each benchmark in their order."""
    try:
        with open(file, encoding="utf-8") as stream:
            run = json.load(stream)
        times = {}
        for b in run["benchmarks"]:
            if b.get("run_type") == "aggregate" or b.get("error_occurred"):
                continue
            name = b.get("run_name", b["name"])
            time = b["cpu_time"] * UNITS[b["time_unit"]] * 1e6
            times[name] = min(time, times.get(name, math.inf))
        context = run["context"]
    except OSError as e:
        sys.exit(f"plot_benchmarks.py: {file}: {e.strerror}")
    except (ValueError, KeyError, TypeError) as e:
        sys.exit(f"plot_benchmarks.py: {file}: no output of --benchmark_format=json: {e!r}")
    if not times:
        sys.exit(f"plot_benchmarks.py: {file}: holds no times")
    return context, times


def describe(file, context):
    words = [os.path.basename(file)]
    if "apso_version" in context:
        words.append("apso " + context["apso_version"])
    return ", ".join(words + [context[k] for k in ("compiler", "flags", "host_name") if k in context])


def quoted(text):
    return "'" + text.replace("'", "''").replace("\n", " ") + "'"


def figure(time):
    """Three digits, and none of those before the point left out."""
    return f"{time:.0f}" if time >= 100 else f"{time:.3g}"


def draw(output, runs, names):
    extension = os.path.splitext(output)[1]
    height = 120 + (16 + 12 * len(runs)) * len(names)
    values = [times[n] for _, _, times in runs for n in names if n in times]
    low = 10 ** math.floor(math.log10(min(values)))
    high = 3 * max(values)  # room for the figure behind the longest bar
    thick = 0.8 / len(runs)
    script = [
        "set terminal " + TERMINALS[extension].format(height=height, inches=height / 110),
        "set output " + quoted(output),
        "set logscale x; set grid x lc rgb '#dddddd'; set xlabel 'CPU time of an iteration [µs]'",
        f"set xrange [{low}:{high}]; set yrange [{len(names) - 0.3}:-0.7]; set style fill solid noborder",
        "set key outside top center vertical maxrows 2 Left reverse noenhanced",
        "set ytics noenhanced (" + ", ".join(f"{quoted(n)} {i}" for i, n in enumerate(names)) + ")",
    ]
    plots, data = [], []
    for k, (file, context, times) in enumerate(runs):
        middle = [i + (k - (len(runs) - 1) / 2) * thick for i in range(len(names))]
        bars = [(times[n], y) for n, y in zip(names, middle) if n in times]
        colour = ("#b5bbc2", "#0072b2")[k + 2 - len(runs)]
        plots.append(f"'-' using 1:2:3:4:5:6 with boxxyerror lc rgb '{colour}' title {quoted(describe(file, context))}")
        data += [f"{low} {y} {low} {t} {y - 0.45 * thick} {y + 0.45 * thick}" for t, y in bars] + ["e"]
        plots.append("'-' using 1:2:3 with labels left offset 0.3,0 notitle")
        data += [f"{t} {y} {figure(t)}" for t, y in bars] + ["e"]
    script += ["plot " + ", ".join(plots)] + data
    try:
        done = subprocess.run(["gnuplot"], input="\n".join(script) + "\n", text=True, capture_output=True, check=False)
    except FileNotFoundError:
        sys.exit("plot_benchmarks.py: gnuplot was not found")
    if done.returncode != 0:
        sys.exit(f"plot_benchmarks.py: {output}: gnuplot failed: {done.stderr.strip()}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", nargs="+", help="output of --benchmark_format=json; of two, the first is the older")
    parser.add_argument("--output", help="picture to write, .svg, .png or .pdf")
    arguments = parser.parse_args()
    if len(arguments.run) > 2:
        parser.error("expected one run or two")
    if not arguments.output and len(arguments.run) == 1:
        parser.error("one run needs --output")
    if arguments.output and os.path.splitext(arguments.output)[1] not in TERMINALS:
        parser.error("--output: expected a file .svg, .png or .pdf")
    if arguments.output in arguments.run:
        parser.error("--output is one of the runs, which are only read")
    runs = [(file, *read(file)) for file in arguments.run]
    names = list(dict.fromkeys(n for _, _, times in runs for n in times))
    if len(runs) == 2:
        old, new = runs[0][2], runs[1][2]
        common = [n for n in names if n in old and n in new]
        if not common:
            sys.exit("plot_benchmarks.py: the runs have no benchmark in common")
        print(f"| benchmark | {arguments.run[0]} [µs] | {arguments.run[1]} [µs] | ratio |\n|---|---|---|---|")
        for n in common:
            print(f"| {n} | {old[n]:.4g} | {new[n]:.4g} | {new[n] / old[n]:.3f} |")
        mean = math.exp(sum(math.log(new[n] / old[n]) for n in common) / len(common))
        print(f"geometric mean of the ratios over {len(common)} benchmarks: {mean:.3f}")
    if arguments.output:
        draw(arguments.output, runs, names)


if __name__ == "__main__":
    main()
