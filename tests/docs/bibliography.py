#!/usr/bin/env python3
"""docs/bibliography.md and the headers agree: every file of a line names its first author, and every source that a header names with a
year has a line. usage: bibliography.py SOURCE_DIR"""
import pathlib
import re
import sys

source = pathlib.Path(sys.argv[1])
headers = source / "include/apso"
page = (source / "docs/bibliography.md").read_text(encoding="utf-8")
lines = re.findall(r"^\| (.+?) \| .+? \| `(.+?)` \|$", page, re.M)
problems = [] if len(lines) > 20 else ["docs/bibliography.md: its tables cannot be read"]
for text, file in lines:
    author = re.match(r"(?:[A-Z]\.[- ]?)*(.+?)[,.]", text).group(1).split()[-1]
    header = headers / file
    if not header.is_file():
        problems.append(f"docs/bibliography.md: there is no include/apso/{file}")
    elif author not in header.read_text(encoding="utf-8"):
        problems.append(f"include/apso/{file} does not name {author}, docs/bibliography.md says that it does")
cited = re.compile(r"\b([A-Z][a-z]+)(?:,? (?:et al\.|(?:&|and) (?:[A-Z]\. )?[A-Z][a-z]+))?,? (?:\(?[A-Z][A-Za-z0-9.& -]{1,40}[, ]+)?((?:19|20)\d\d)\b")
for header in sorted(headers.rglob("*.hpp")):
    for line in header.read_text(encoding="utf-8").splitlines():
        if "//" not in line:
            continue
        for author, year in cited.findall(line[line.index("//"):]):
            if not any(author in text for text, _ in lines):
                problems.append(f"{header.relative_to(source)}: {author} {year} is not in docs/bibliography.md")
sys.exit("\n".join(problems) or 0)
