#!/usr/bin/env python3
"""Runs the ablation of the method on all recordings of a folder and on the synthetic ones, and writes docs/results.md.

    scripts/results.sh DATA                    # or APSO_DATA_DIR=DATA scripts/results.sh
    scripts/results.sh DATA --seeds 3 --table  # only the table, of what has been run

It can be stopped and started: a run is a folder, and finished ones are kept. The folders are keyed by the program that made them, so
runs of two versions never mix. Standard library only.
"""
import argparse
import csv
import hashlib
import json
import math
import os
import pathlib
import re
import subprocess
import sys
import textwrap

ROOT = pathlib.Path(__file__).resolve().parent.parent

# Variants of apso_ablate in the order of the tables, and what they are called there.
VARIANTS = {
    "plain": "features alone",
    "no_refinement": "+ masks",
    "bad_only": "+ BAD frames repaired",
    "default": "+ every frame (default)",
    "true_masks": "default, true masks",
    "paper": "as printed",
}
MEANING = {
    "plain": "the feature tracker, nothing masked, nothing refined",
    "no_refinement": "what moves is masked by the geometric policy, without a network",
    "bad_only": "also frames that are called BAD are repaired by direct alignment: the paper's switch, in this library's forms",
    "default": "also GOOD frames are refined: as shipped",
    "true_masks": "as shipped, with the generator's masks in place of the policy's: what better masks could gain",
    "paper": "`paper_options()`, equations (1) to (17) in the printed forms",
}
SYNTHETIC = {
    "people walk": ["walking_xyz", "walking_halfsphere", "walking_rpy", "walking_static"],
    "people sit, rise and walk": ["rising_xyz", "rising_halfsphere", "rising_rpy", "rising_static"],
    "brought down on purpose": ["stress_ceiling", "stress_roll", "stress_crowd", "stress_dark", "stress_flash", "stress_dropout", "stress_all"],
    "nobody moves": ["static_xyz", "static_halfsphere", "static_rpy", "static_static"],
}
CAMERAS = [("freiburg1", "tum-fr1"), ("fr1", "tum-fr1"), ("freiburg2", "tum-fr2"), ("fr2", "tum-fr2"), ("freiburg3", "tum-fr3"),
           ("fr3", "tum-fr3"), ("bonn", "bonn"), ("icl", "icl-nuim")]
SHORTEST = 30  # frames; a pair is no recording
# 0.975 quantile of Student's t by degrees of freedom
STUDENT = [12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145]


def fail(text):
    sys.exit(f"results.py: {text}")


# ---------------------------------------------------------------------------------------------- what to run on

def stamps_of(folder):
    """Time stamps of a recording in TUM format; none if the folder is none."""
    for name in ("associations.txt", "rgb.txt"):
        file = folder / name
        if not file.is_file() or (name == "rgb.txt" and not (folder / "depth.txt").is_file()):
            continue
        lines = [line.split() for line in file.read_text(encoding="utf-8", errors="replace").splitlines()]
        return [float(f[0]) for f in lines if f and not f[0].startswith("#")]
    return []


def nominal(stamps):
    """Whole multiples of one step, to the last digit: numbers of frames, not times of a camera."""
    steps = [b - a for a, b in zip(stamps, stamps[1:])]
    step = min(steps, default=0)
    return step > 0 and all(abs(s / step - round(s / step)) < 1e-3 for s in steps)


def recordings(data):
    """Specifications for apso_ablate of all recordings in a folder, and two folders deep, with what is known of them."""
    found = {}
    for folder in [data] + sorted(p for pattern in ("*", "*/*") for p in data.glob(pattern) if p.is_dir()):
        try:
            stamps = stamps_of(folder)
        except ValueError:
            stamps = []
        if len(stamps) < SHORTEST or not (folder / "groundtruth.txt").is_file():
            continue
        camera = str(folder / "camera.yaml") if (folder / "camera.yaml").is_file() else next(
            (camera for part, camera in CAMERAS if part in folder.name.lower()), None)
        if camera is None:
            print(f"results.py: {folder}: left out: no camera.yaml, and its name tells no camera", file=sys.stderr)
            continue
        if "," in str(folder):
            fail(f"{folder}: a comma in the path cannot be given to apso_ablate")
        spec = f"{folder},camera={camera}"
        if (folder / "groundtruth_camera.txt").is_file():
            spec += f",camera-truth={folder / 'groundtruth_camera.txt'}"
        found[spec] = {"name": folder.name, "frames": len(stamps), "nominal": nominal(stamps)}
    return found


# ---------------------------------------------------------------------------------------------- figures

def mean(values):
    return sum(values) / len(values) if values else math.nan


def interval(values):
    """Half of the 95 % interval of the mean."""
    n = len(values)
    if n < 2:
        return math.nan
    m = mean(values)
    quantile = STUDENT[n - 2] if n - 2 < len(STUDENT) else 1.96 + 2.5 / (n - 1)
    return quantile * math.sqrt(sum((v - m) ** 2 for v in values) / (n - 1) / n)


def number(value, digits):
    return "–" if math.isnan(value) else f"{value:.{digits}f}"


def spread(values, digits):
    values = [v for v in values if v is not None]
    half = interval(values)
    return number(mean(values), digits) + ("" if math.isnan(half) else f" ± {half:.{digits}f}")


class Results:
    """ablation.json by sequence, repetition and variant. Of a sequence only repetitions that every variant has finished count."""

    def __init__(self, file):
        with open(file, encoding="utf-8") as stream:
            self.file = json.load(stream)
        self.by = {}
        self.decisions = {}
        for entry in self.file["by_sequence"]:
            runs = {}
            for run in entry["runs"]:
                runs[int(re.search(r"_r(\d+)$", run["folder"]).group(1))] = run
            self.by.setdefault(entry["sequence"], {})[entry["variant"]] = runs
            self.decisions[entry["sequence"], entry["variant"]] = entry

    def variants(self, sequence):
        """Variants that can be run on a sequence: a recording has no true masks."""
        return [v for v in VARIANTS if v in self.by[sequence] and (v != "true_masks" or sequence.startswith("synthetic:"))]

    def repetitions(self, sequence):
        return sorted(set.intersection(*(set(self.by[sequence][v]) for v in self.variants(sequence))))

    def runs(self, sequence, variant):
        return [self.by[sequence][variant][r] for r in self.repetitions(sequence)]

    def values(self, sequence, variant, figure):
        return [run[figure] for run in self.runs(sequence, variant)]


def label(sequence, known):
    return known[sequence]["name"] if sequence in known else sequence.split(":")[1].split(",")[0]


def header(columns):
    return ["| " + " | ".join(columns) + " |", "|" + "---|" * len(columns)]


def row(cells):
    return "| " + " | ".join(cells) + " |"


def of_group(results, sequences, variant, figure):
    """A figure as the mean over the sequences of a group, once per repetition that all of them have."""
    have = [set(results.repetitions(s)) for s in sequences]
    values = []
    for r in sorted(set.intersection(*have)) if have else []:
        one = [results.by[s][variant][r][figure] for s in sequences]
        one = [v for v in one if v is not None]
        if one:
            values.append(mean(one))
    return values


def shares(results, sequences, variant, part, whole):
    """Percent of a count in another over all runs of a group; and both counts."""
    have = [set(results.repetitions(s)) for s in sequences]
    rounds = set.intersection(*have) if have else set()
    a = b = 0
    for s in sequences:
        for r in rounds:
            run = results.by[s][variant][r]
            a += run[part] or 0
            b += run[whole] or 0
    return a, b


def summary_table(results, sequences, one_second=True):
    columns = ["variant", "runs", "poses", "ATE [mm]", "1 s [mm]", "1 frame [mm]", "wrong of GOOD", "ms"]
    if not one_second:
        columns.remove("1 s [mm]")
    lines = header(columns)
    names = [v for v in VARIANTS if all(v in results.variants(s) for s in sequences)]
    rounds = set.intersection(*(set(results.repetitions(s)) for s in sequences))
    for v in names:
        posed, frames = shares(results, sequences, v, "pairs", "frames")
        wrong, good = shares(results, sequences, v, "wrong_good", "good")
        cells = [VARIANTS[v], str(len(sequences) * len(rounds)), f"{100 * posed / frames:.1f} %" if frames else "–"]
        figures = [("ate_m", 1)] + ([("rpe_1s_m", 1)] if one_second else []) + [("rpe_1f_m", 2)]
        for figure, digits in figures:
            cells.append(spread([1e3 * x for x in of_group(results, sequences, v, figure)], digits))
        cells.append(f"{wrong:.0f} of {good:.0f}")
        cells.append(number(mean(of_group(results, sequences, v, "median_ms")), 0))
        lines.append(row(cells))
    return lines


def wide_table(results, sequences, known, cell):
    """One row per sequence, one column per variant."""
    names = [v for v in VARIANTS if any(v in results.variants(s) for s in sequences)]
    lines = header(["", "runs"] + [VARIANTS[v] for v in names])
    for s in sequences:
        lines.append(row([label(s, known), str(len(results.repetitions(s)))] +
                         [cell(s, v) if v in results.variants(s) else "–" for v in names]))
    return lines


def ate_cell(results):
    def cell(s, v):
        runs = results.runs(s, v)
        lost = sum(run["lost"] for run in runs)
        text = spread([1e3 * x["ate_m"] for x in runs if x["ate_m"] is not None], 1)
        pairs = mean([x["pairs"] or 0 for x in runs])
        return f"{text} ({pairs:.0f} of {runs[0]['frames']:.0f})" + (f", {lost} lost" if lost else "")
    return cell


def rpe_cell(results, known, seconds):
    def cell(s, v):
        if seconds and s in known and known[s]["nominal"]:
            return "nominal stamps"
        name = "rpe_1s" if seconds else "rpe_1f"
        metres = [1e3 * x for x in results.values(s, v, name + "_m") if x is not None]
        degrees = [x for x in results.values(s, v, name + "_deg") if x is not None]
        return f"{spread(metres, 1 if seconds else 2)} / {number(mean(degrees), 2 if seconds else 3)}"
    return cell


def decision_table(results, sequences, known):
    lines = header(["", "decisions", "failed", "AUC, default", "AUC, as printed", "wrong of GOOD, default", "as printed"])
    for s in sequences:
        cells = [label(s, known)]
        entry = results.decisions[s, "default"]
        cells += [str(entry["decided"]), str(entry["failed"])]
        for v in ("default", "paper"):
            e = results.decisions.get((s, v))
            few = e is None or e["auc"] is None or e["failed"] < 10
            cells.append("–" if few else f"{e['auc']:.3f}")
        for v in ("default", "paper"):
            if v not in results.variants(s):
                cells.append("–")
                continue
            wrong, good = shares(results, [s], v, "wrong_good", "good")
            cells.append(f"{wrong:.0f} of {good:.0f}")
        lines.append(row(cells))
    return lines


# ---------------------------------------------------------------------------------------------- published figures

PUBLISHED = ["walking_halfsphere", "walking_xyz", "walking_rpy", "walking_static", "sitting_static", "sitting_xyz", "sitting_halfsphere"]


def own_fr3(results, known, figure):
    """This program on recordings of TUM freiburg3, if they are in the folder."""
    rows = []
    for v in ("default", "bad_only", "paper"):
        cells = []
        for name in PUBLISHED:
            match = [s for s in known if "freiburg3" in known[s]["name"] and known[s]["name"].endswith(name) and v in results.variants(s)]
            values = [x for x in results.values(match[0], v, figure) if x is not None] if match else []
            cells.append(number(mean(values), 4) if values else "")
        if any(cells):
            rows.append(row([f"**apso, {VARIANTS[v]}**", "", "CPU", "this page"] + cells))
    return rows


def published_table(kind, results, known):
    figure = {"ate": "ate_m", "network_free": "ate_m", "rpe_1s": "rpe_1s_m", "rpe_1f": "rpe_1f_m"}[kind]
    lines = header(["system", "year", "needs", "source"] + [name.replace("_", " ") for name in PUBLISHED])
    with open(ROOT / "scripts/published_results.csv", encoding="utf-8", newline="") as stream:
        for entry in csv.DictReader(stream):
            if entry["table"] == kind:
                lines.append(row([entry["system"], entry["year"], entry["needs"], entry["source"]] + [entry[n] for n in PUBLISHED]))
    return lines + own_fr3(results, known, figure)


# ---------------------------------------------------------------------------------------------- the page

def git(*words):
    try:
        return subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""


def source_of(stamp):
    """Version and commit that the programs were built from."""
    commit = stamp.get("commit", "")
    return f"version {stamp['version']}" + (f", commit `{commit}`" if commit else "")


def busy(stamp):
    """What else the machine did while the runs were made."""
    load = stamp.get("load", 0)
    if load < 1.3 * os.cpu_count():
        return "."
    return (f". The machine did other things as well (load average {load:.0f}): the times are several times those of an idle one, and only "
            "their ratios say something.")


def page(results, known, spec, args, stamp):
    real = list(known)
    count = {s: len(results.repetitions(s)) for s in results.by}
    def have(names):
        return [spec(n) for n in names if count.get(spec(n), 0) > 0]

    real = [s for s in real if s in results.by and count[s] > 0]
    seeds = sorted({count[s] for names in SYNTHETIC.values() for s in have(names)})
    said = "no" if not seeds else str(seeds[0]) if len(seeds) == 1 else f"{seeds[0]} to {seeds[-1]}"
    repeats = sorted({count[s] for s in real})
    said_real = "no" if not repeats else str(repeats[0]) if len(repeats) == 1 else f"{repeats[0]} to {repeats[-1]}"
    out = ["# Results", "",
           f"Made by `scripts/results.sh DATA`, {source_of(stamp)}, with {said} of {args.seeds} seeds of each synthetic recording (from seed "
           f"{args.first_seed}) and {said_real} of {args.recorded} runs of each real one.", ""]
    wanted = sum(len(n) for n in SYNTHETIC.values())
    done = sum(len(have(n)) for n in SYNTHETIC.values())
    if seeds != [args.seeds] or repeats not in ([args.recorded], []) or done < wanted:
        out += ["The set is not complete. The same command goes on where it was stopped, and writes this page again; with the same program, "
                "what is done stays.", ""]
        missing = [n for names in SYNTHETIC.values() for n in names if not have([n])] + [known[s]["name"] for s in known if s not in real]
        if missing:
            out[-2] += " Not measured yet: " + ", ".join(missing) + "."
    out += ["Real and synthetic recordings are never in one mean. Each is run with six variants, each of which has all of the one before it "
            "up to the default:", ""]
    out += header(["variant", "what it is", "`apso_ablate --only`"])
    out += [row([VARIANTS[v], MEANING[v], f"`{v}`"]) for v in VARIANTS]
    out += ["", "- **ATE**: rmse after rigid alignment, over the poses given as pairs; the rule of association is that of `apso_eval`. A lost "
            "frame has no pose: an ATE over fewer pairs is not better than one over more.",
            "- **1 s**, **1 frame**: rmse of the error of the motion over that time, translation [mm] and, after the stroke, rotation [degrees].",
            "- **wrong of GOOD**: frames called GOOD whose motion since the frame before is wrong by more than 2 cm or 1 degree.",
            "- **AUC**: area under the ROC curve of 1 - S_final for frames in which the feature tracker fails (lost, or an error from frame to "
            "frame above three times the median of the run), all runs together; left out below ten failures.",
            f"- **ms**: median time of a frame by the clock, without loading, one thread, {args.jobs} runs at a time on {os.cpu_count()} cores"
            f"{busy(stamp)} The variants of a synthetic recording share the features, and each counts the time of the run that found them.",
            "- ±: half of the 95 % interval of the mean (Student). Runs of a synthetic recording differ by the seed of room, people, path and "
            "noise. Those of a real one differ in the number of features (1000, 990, 1010, 980, 1020), which no result should depend on: their "
            "interval says how far chance in the program goes, and nothing about other recordings.", ""]
    out += ["## What each part is worth", ""]
    if real:
        out += ["### Real recordings", ""] + summary_table(results, real, not any(known[s]["nominal"] for s in real)) + [""]
    for title, names in SYNTHETIC.items():
        if have(names):
            out += [f"### Synthetic: {title}", ""] + summary_table(results, have(names)) + [""]
    everything = real + [s for names in SYNTHETIC.values() for s in have(names)]
    groups = [("Real", real), ("Synthetic", everything[len(real):])]
    for title, text, cell in [("ATE [mm]", "Mean ± interval (pairs of frames).", ate_cell(results)),
                              ("Motion over one second [mm / degrees]", "", rpe_cell(results, known, True)),
                              ("Motion from frame to frame [mm / degrees]", "", rpe_cell(results, known, False))]:
        out += [f"## {title}", ""] + ([text, ""] if text else [])
        for name, sequences in groups:
            if sequences:
                out += [f"### {name}", ""] + wide_table(results, sequences, known, cell) + [""]
    out += ["Nominal stamps: the recording has numbers of frames in place of times, so there is no second to measure over.", ""]
    out += ["## Does S_final tell which frames fail?", ""]
    for name, sequences in groups:
        if sequences:
            out += [f"### {name}", ""] + decision_table(results, sequences, known) + [""]
    out += ["## Published figures", "",
            "Of other systems on the whole recordings TUM freiburg3, from their papers; tables are often copies of copies, so look into the "
            "paper before quoting one. They can be compared with a row of apso only where one stands below them, which needs these recordings "
            "in the folder; the synthetic recordings above have the same names and motions, but are other, cleaner scenes. Differences of 1 to 3 mm "
            "between systems are smaller than the spread of one system over several runs.", "",
            "### ATE rmse [m], RGB-D, rigid alignment", ""] + published_table("ate", results, known)
    out += ["", "### ATE rmse [m] without a network", ""] + published_table("network_free", results, known)
    out += ["", "### Motion over one second, rmse [m / degrees]", ""] + published_table("rpe_1s", results, known)
    out += ["", "### Motion from frame to frame, rmse [m / degrees]", ""] + published_table("rpe_1f", results, known)
    out += ["", "The paper prints these figures beside those of others over one second. Their size is that of an error from frame to frame, and "
            "so is their ratio to the ATE: they are not comparable with the table above.", "",
            "### Bonn crowd, ATE rmse [m]", ""]
    out += header(["system", "needs", "frames", "ATE", "source"])
    out += [row(cells) for cells in [
        ["ReFusion", "GPU", "927", "0.204", "Palazzolo et al., IROS 2019"],
        ["StaticFusion", "GPU", "927", "3.586", "Palazzolo et al., IROS 2019"],
        ["DynaSLAM, geometry alone", "CPU", "927", "1.065", "Palazzolo et al., IROS 2019"],
        ["DynaSLAM", "Mask R-CNN, GPU", "927", "0.016", "Palazzolo et al., IROS 2019"],
        ["ORB-SLAM3", "CPU", "927", "0.27, 0.40, 0.85, 1.43", "four runs of its public source"],
        ["NGD-SLAM", "YOLO-fastest, CPU", "927", "0.059", "a run of its public source"],
        ["ORB-SLAM3", "CPU", "220 (pairs 180..399)", "0.48", "a run of its public source"]]]
    crowd = [s for s in real if "crowd" in known[s]["name"]]
    for v in ("plain", "default", "paper"):
        if crowd:
            values = [x for x in results.values(crowd[0], v, "ate_m") if x is not None]
            out.append(row([f"**apso, {VARIANTS[v]}**", "CPU", f"{known[crowd[0]]['frames']}", spread(values, 4), "this page"]))
    out += ["", "The last rows are over a part of the recording that has all of its people; the whole one is longer, and not comparable.", ""]
    lines = [part for line in out for part in ([line] if line.startswith(("|", "#")) or not line else
                                               textwrap.wrap(line, 138, subsequent_indent="  " if line.startswith("- ") else "",
                                                             break_long_words=False, break_on_hyphens=False))]
    return "\n".join(lines)


# ---------------------------------------------------------------------------------------------- main

def main():
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("data", nargs="?", default=os.environ.get("APSO_DATA_DIR"),
                   help="folder with recordings in TUM format (default: $APSO_DATA_DIR; none: only synthetic ones)")
    p.add_argument("--output", default=str(ROOT / "docs/results.md"), help="the page (default: docs/results.md)")
    p.add_argument("--runs", default=str(ROOT / "out/results"), help="folder for the runs (default: out/results)")
    p.add_argument("--programs", default=str(ROOT / "build/bin"), help="folder of apso_ablate and apso_track (default: build/bin)")
    p.add_argument("--seeds", type=int, default=10, help="runs of each synthetic recording, at least 2 (default: 10)")
    p.add_argument("--first-seed", type=int, default=1, help="1 to 10 report, from 100 on develop (default: 1)")
    p.add_argument("--recorded", type=int, default=5, help="runs of each real recording, at least 2 (default: 5)")
    p.add_argument("--frames", type=int, help="only the first frames of each recording, to try the script")
    p.add_argument("--synthetic", help="only these synthetic recordings, names with commas between")
    p.add_argument("--jobs", type=int, default=2, help="runs at a time (default: 2)")
    p.add_argument("--table", action="store_true", help="run nothing, only write the page of what has been run")
    args = p.parse_args()
    if args.seeds < 2 or args.recorded < 2:
        p.error("--seeds and --recorded are at least 2: a single run has no interval")
    programs = pathlib.Path(args.programs)
    for name in ("apso_ablate", "apso_track"):
        if not (programs / name).is_file():
            fail(f"{programs / name}: is not there; scripts/results.sh builds it")
    if args.data and not pathlib.Path(args.data).is_dir():
        fail(f"{args.data}: no such folder")
    known = recordings(pathlib.Path(args.data)) if args.data else {}
    only = set(args.synthetic.split(",")) if args.synthetic else None
    for group in SYNTHETIC:
        SYNTHETIC[group] = [n for n in SYNTHETIC[group] if only is None or n in only]
    if only is not None and only != {n for names in SYNTHETIC.values() for n in names}:
        p.error("--synthetic: unknown name in " + args.synthetic)
    suffix = f",max-frames={args.frames}" if args.frames else ""
    known = {s + suffix: k for s, k in known.items()}

    def spec(name):
        frames = args.frames or (540 if name == "stress_all" else 0)  # 540 frames have all kinds of stress
        return f"synthetic:{name}" + (f",max-frames={frames}" if frames else "") + f",seed={args.first_seed}"

    sequences = list(known) + [spec(n) for names in SYNTHETIC.values() for n in names]

    digest = hashlib.sha256((programs / "apso_track").read_bytes()).hexdigest()[:12]
    version = subprocess.run([str(programs / "apso_ablate"), "--version"], capture_output=True, text=True).stdout.split()
    folder = pathlib.Path(args.runs) / digest
    folder.mkdir(parents=True, exist_ok=True)
    made = folder / "made_by.json"
    if made.is_file():
        stamp = json.loads(made.read_text(encoding="utf-8"))
    else:
        commit = git("rev-parse", "--short", "HEAD")
        if commit and git("status", "--porcelain", "--", "include", "examples", "CMakeLists.txt", "cmake"):
            commit += " with changes"
        stamp = {"version": version[-1] if version else "unknown", "commit": commit, "load": 0}
        made.write_text(json.dumps(stamp) + "\n", encoding="utf-8")

    command = [str(programs / "apso_ablate"), *sequences, "--only", ",".join(VARIANTS), "--repeats", str(args.seeds), "--recorded-repeats",
               str(args.recorded), "--jobs", str(args.jobs), "--output", str(folder)] + (["--table"] if args.table else [])
    def note_load():
        stamp["load"] = max(stamp.get("load", 0), os.getloadavg()[2])
        made.write_text(json.dumps(stamp) + "\n", encoding="utf-8")

    if not args.table:
        note_load()
    code = subprocess.run(command).returncode
    if not args.table:
        note_load()
    if not (folder / "ablation.json").is_file():
        fail(f"apso_ablate ended with {code}")
    results = Results(folder / "ablation.json")
    text = page(results, known, spec, args, stamp)
    part = pathlib.Path(args.output + ".part")
    part.write_text(text, encoding="utf-8")
    os.replace(part, args.output)
    print(f"results.py: wrote {args.output}")
    return code


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        fail("stopped; the same command goes on from here, and --table writes the page of what is done")
