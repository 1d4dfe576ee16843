"""The LaTeX tables in a minimal document, by a real TeX engine where there is one."""

import re
import shutil
import subprocess

import pytest

from rotcli.cli.main import main
from rotcli.report.render import as_latex
from rotcli.report.report import gather

ENGINE = shutil.which("pdflatex") or shutil.which("lualatex") or shutil.which("xelatex")


def _has_siunitx():
    finder = shutil.which("kpsewhich")
    if finder is None:
        return False
    return bool(subprocess.run([finder, "siunitx.sty"], capture_output=True, check=False).stdout)


needs_tex = pytest.mark.skipif(
    ENGINE is None or not _has_siunitx(),
    reason="no TeX engine with siunitx on this machine (Debian: texlive-science); "
    "structure is checked in any case",
)
DOCUMENT = r"""\documentclass[a4paper%s]{article}
\usepackage[T1]{fontenc}
\usepackage{booktabs,siunitx,graphicx}
\begin{document}
%s
\end{document}
"""


def compile_latex(folder, text, options=""):
    """Return by how much boxes are too wide, pt; fails where TeX stops."""
    (folder / "t.tex").write_text(DOCUMENT % (options, text), encoding="utf-8")
    done = subprocess.run(
        [ENGINE, "-interaction=nonstopmode", "-halt-on-error", "t.tex"],
        cwd=folder,
        capture_output=True,
        check=False,
        timeout=120,
    )
    log = done.stdout.decode("utf-8", "replace")
    assert done.returncode == 0, log[-3000:]
    assert (folder / "t.pdf").stat().st_size > 1000
    return [float(size) for size in re.findall(r"Overfull \\hbox \((\d+\.\d+)", log)]


@pytest.fixture
def report(documents, tmp_path):
    docs = [*documents.small_campaign("NAV440 50% & #1_$x$"), documents.allan("NAV440")]
    docs.append(documents.navigation("NAV440", "full", 40.0, 3, 4, warnings=["a gap"]))
    return as_latex(gather(documents.write(tmp_path, *docs), "t"))


@pytest.fixture
def budget(tmp_path, capsys):
    with pytest.raises(SystemExit):
        main(["budget", "--imu", "nav440", "--rate", "10", "-o", str(tmp_path / "b.tex")])
    capsys.readouterr()
    return (tmp_path / "b.tex").read_text(encoding="utf-8")


@needs_tex
@pytest.mark.parametrize("columns", ["", ",twocolumn"])
@pytest.mark.parametrize("name", ["report", "budget"])
def test_the_tables_compile_and_fit_one_column_and_two(name, columns, request, tmp_path):
    wide = compile_latex(tmp_path, request.getfixturevalue(name), columns)
    assert [size for size in wide if size > 5.0] == []


@needs_tex
def test_a_broken_table_would_be_seen(report, tmp_path):
    with pytest.raises(AssertionError, match="Undefined control sequence"):
        compile_latex(tmp_path, report.replace("\\toprule", "\\toprul", 1))


@pytest.mark.parametrize("name", ["report", "budget"])
def test_the_structure_is_that_of_booktabs(name, request):
    text = "\n".join(
        line for line in request.getfixturevalue(name).splitlines() if not line.startswith("%")
    )
    stack = []
    for kind, environment in re.findall(r"\\(begin|end)\{(\w+)\}", text):
        if kind == "begin":
            stack.append(environment)
        else:
            assert stack.pop() == environment
    assert stack == []
    assert text.count("\\toprule") == text.count("\\midrule") == text.count("\\bottomrule") > 2
    bare = re.sub(r"\\[{}]", "", text)
    assert bare.count("{") == bare.count("}")
    assert text.isascii()
