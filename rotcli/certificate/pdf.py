"""Print a page to PDF with a Chromium browser without a window."""

import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

from rotcli.errors import ResultError

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
TIMEOUT = 120.0  # s; a page takes two on a slow machine
# The browser writes the time of printing and counts the nodes of the page from a number that
# differs from run to run: the same page must give the same bytes.
_DATES = re.compile(rb"/(CreationDate|ModDate) \(D:(\d{14})")
_NODES = re.compile(rb"\(node(\d{8})\)")


def find_browser() -> str | None:
    """Return the command of a Chromium browser, or None."""
    return next((found for name in BROWSERS if (found := shutil.which(name))), None)


def to_pdf(html: str, path: str) -> bytes:
    """Return the page as PDF; raises ResultError, naming `path`, where no browser can print it."""
    browser = find_browser()
    if browser is None:
        raise ResultError(
            f"{path}: no Chromium browser to print a PDF; install one, or write .html and print it"
        )
    with tempfile.TemporaryDirectory() as folder:
        page, pdf = Path(folder) / "page.html", Path(folder) / "page.pdf"
        page.write_text(html, encoding="utf-8")
        command = [
            browser,
            "--headless",
            "--disable-gpu",
            "--no-pdf-header-footer",
            f"--user-data-dir={folder}/profile",
            f"--print-to-pdf={pdf}",
            page.as_uri(),
        ]
        if hasattr(os, "geteuid") and os.geteuid() == 0:
            command.insert(1, "--no-sandbox")  # Chromium refuses to run as root with its sandbox
        try:
            subprocess.run(command, capture_output=True, timeout=TIMEOUT, check=True)
            data = pdf.read_bytes()
        except (OSError, subprocess.SubprocessError) as fault:
            raise ResultError(
                f"{path}: {Path(browser).name} did not print the page "
                f"({type(fault).__name__}); write .html and print it"
            ) from fault
    return reproducible(data)


def reproducible(pdf: bytes) -> bytes:
    """Return the PDF with a fixed date and with nodes counted from 1, in the same order."""
    found = sorted(set(_NODES.findall(pdf)))
    rank = {number: b"(node%08d)" % k for k, number in enumerate(found, 1)}
    numbered = _NODES.sub(lambda match: rank[match[1]], pdf)
    return _DATES.sub(rb"/\1 (D:20000101000000", numbered)
