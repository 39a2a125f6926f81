"""What the pages need besides their text when they become the site.

- Links to files outside of docs/ (programs, headers, scripts) lead to copies of them in files/, so that the site is complete by itself.
- A line `<!-- program: FILE -->` becomes the file.
- The API reference is made by doxygen, if it is installed, and put into reference/.
"""
import pathlib
import posixpath
import re
import shutil
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
linked = set()


def on_files(files, config):
    for file in [f for f in files if f.src_path in ("Doxyfile", "mainpage.dox", "site_hook.py")]:
        files.remove(file)  # what the site is made with is no part of it
    return files


def on_page_markdown(markdown, page, config, **_):
    folder = posixpath.dirname(page.file.src_path)
    up = "../" * page.url.rstrip("/").count("/") + ("../" if page.url.rstrip("/") and page.url.endswith("/") else "")
    if page.url in ("", "./", "."):
        up = ""

    def link(match):
        target = posixpath.normpath(posixpath.join(folder, match.group(2)))
        if not target.startswith(".."):
            return match.group(0)
        file = ROOT / posixpath.normpath(posixpath.join("docs", target))
        words = match.group(1)
        if not file.is_file():
            return f"`{words.strip('`')}`"
        name = file.relative_to(ROOT).as_posix()
        linked.add(name)
        return f'<a href="{up}files/{name}.txt">{words.strip("`")}</a>'

    def program(match):
        text = (ROOT / match.group(1)).read_text(encoding="utf-8")
        return f"```cpp\n{text}```\n"

    markdown = re.sub(r"^<!-- program: (\S+) -->$", program, markdown, flags=re.M)
    return re.sub(r"(?<!!)\[([^\]]*)\]\(([^):#]+)(?:#[^)]*)?\)", link, markdown)


def on_post_build(config, **_):
    site = pathlib.Path(config["site_dir"])
    for name in sorted(linked):
        to = site / "files" / (name + ".txt")
        to.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(ROOT / name, to)
    doxygen = shutil.which("doxygen")
    if doxygen is not None:
        make_reference(site, doxygen)
    check_links(site, without=None if doxygen else "reference")


def make_reference(site, doxygen):
    with tempfile.TemporaryDirectory() as scratch:
        settings = (ROOT / "docs/Doxyfile").read_text(encoding="utf-8") + f"OUTPUT_DIRECTORY = {scratch}\n"
        subprocess.run([doxygen, "-"], input=settings, text=True, cwd=ROOT, check=True)
        shutil.rmtree(site / "reference", ignore_errors=True)
        shutil.copytree(pathlib.Path(scratch) / "html", site / "reference")


def check_links(site, without):
    """mkdocs looks at links between pages, not at those in HTML."""
    dead = set()
    for page in site.rglob("*.html"):
        if page.relative_to(site).parts[0] in ("reference", "404.html"):
            continue
        for target in re.findall(r'href="([^"#:?]+)"', page.read_text(encoding="utf-8")):
            if not (page.parent / target).exists() and not (without and without in target):
                dead.add(f"{page.relative_to(site)}: {target}")
    if dead:
        raise RuntimeError("dead links: " + ", ".join(sorted(dead)))
