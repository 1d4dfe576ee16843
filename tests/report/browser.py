"""A real browser without a window: what a page logs, fetches and measures at a width."""

import html
import json
import re
import shutil
import subprocess

NAMES = ("chromium", "chromium-browser", "google-chrome")
WHY_NOT = "no Chromium on this machine: scripts/install-browser.sh (make browser) installs it"

# Looks at a page inside a frame of a given width.
LOOK = """
function look(frame) {
  const doc = frame.contentDocument, win = frame.contentWindow, width = win.innerWidth;
  const out = [];
  const walker = doc.createTreeWalker(doc.body, win.NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode, holder = node.parentElement;
    if (!node.data.trim() || holder.closest("svg, style, script")) continue;
    const range = doc.createRange();
    range.selectNodeContents(node);
    const box = holder.closest(".table") || doc.documentElement;
    const scrolls = win.getComputedStyle(box).overflowX === "auto";
    const left = box.getBoundingClientRect().left - 1;
    const right = scrolls ? left + 2 + box.scrollWidth : width + 1;
    for (const rect of range.getClientRects())
      if (rect.width > 0 && (rect.left < left || rect.right > right))
        out.push(node.data.trim().slice(0, 60));
  }
  for (const svg of doc.querySelectorAll("svg.plot")) {
    const frame = svg.getBoundingClientRect();
    if (frame.right > width + 1 || frame.width < 200 || frame.height < 100) out.push("a figure");
    for (const part of svg.querySelectorAll("g[id*='text_']")) {
      const r = part.getBoundingClientRect();
      if (r.left < frame.left - 1 || r.right > frame.right + 1 || r.top < frame.top - 1 ||
          r.bottom > frame.bottom + 1) out.push("text in a figure: " + svg.ariaLabel);
    }
  }
  return {
    width: width, scroll: doc.documentElement.scrollWidth, overflowing: out,
    figures: doc.querySelectorAll("svg.plot").length,
    tables: [...doc.querySelectorAll("table")].map(t => ({
      display: win.getComputedStyle(t).display, heads: t.querySelectorAll("thead th").length,
      rows: t.tBodies.length ? t.tBodies[0].rows.length : 0,
      cells: Math.max(0, ...[...t.rows].map(row => row.cells.length)),
      scrolls: t.parentElement.scrollWidth > t.parentElement.clientWidth + 1,
      name: t.caption ? t.caption.innerText : ""})),
    fetched: win.performance.getEntriesByType("resource").map(entry => entry.name),
  };
}
"""


def browser():
    """Return the browser's command, or None."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)


def run(folder, page, *options):
    """Open a page and return what the browser wrote to standard output and standard error."""
    command = [
        browser(),
        "--headless=new",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
        "--disable-component-update",
        "--host-resolver-rules=MAP * ~NOTFOUND",
        "--hide-scrollbars",
        f"--user-data-dir={folder / 'profile'}",
        *options,
        page.as_uri(),
    ]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=60)


def console(folder, text):
    """Return what the browser's console says of a page."""
    page = folder / "page.html"
    page.write_text(text)
    done = run(folder, page, "--enable-logging=stderr", "--dump-dom")
    return [line for line in done.stderr.splitlines() if "CONSOLE" in line]


def measure(folder, text, *widths):
    """Return what LOOK sees of a page at each width, px.

    The page is in frames of those widths, for a window cannot be narrower than 500 px; its
    content security policy, which would hold our own script off, is left out.
    """
    open_page = re.sub(r'<meta http-equiv="Content-Security-Policy"[^>]*>', "", text)
    frames = "".join(
        f'<iframe style="width:{width}px;height:900px;border:0" srcdoc="{html.escape(open_page)}">'
        "</iframe>"
        for width in widths
    )
    ready = (
        "addEventListener('load', () => document.body.dataset.found = JSON.stringify("
        "[...document.querySelectorAll('iframe')].map(look)));"
    )
    page = folder / "measured.html"
    page.write_text(
        f"<!DOCTYPE html><meta charset='utf-8'><body>{frames}<script>{LOOK}{ready}</script></body>"
    )
    done = run(folder, page, "--window-size=1600,1000", "--dump-dom")
    found = re.search(r'data-found="([^"]*)"', done.stdout)
    assert found, done.stderr[-2000:]
    return json.loads(html.unescape(found[1]))


def screenshot(folder, text, target, width, height):
    """Write a picture of a page (PNG) as wide as asked for, from 500 px."""
    page = folder / "page.html"
    page.write_text(text)
    run(folder, page, f"--window-size={width},{height}", f"--screenshot={target}")
