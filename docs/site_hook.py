"""Links to files outside of docs/ (programs, headers) work when the pages are read in the repository; on the site only their text stays."""
import posixpath
import re


def on_page_markdown(markdown, page, **_):
    folder = posixpath.dirname(page.file.src_path)

    def link(match):
        target = posixpath.normpath(posixpath.join(folder, match.group(2)))
        return f"`{match.group(1).strip('`')}`" if target.startswith("..") else match.group(0)

    return re.sub(r"(?<!!)\[([^\]]*)\]\(([^):#]+)(?:#[^)]*)?\)", link, markdown)
