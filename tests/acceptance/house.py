"""Volume and spread of the code: lines, files, what a decay loads, files with one importer.

    python -m tests.acceptance.house

Lines of code are those with anything but comments and docstrings.
"""

import ast
import io
import subprocess
import sys
import tempfile
import tokenize
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDERS = ("labrig", "drivers", "protocols", "sim")
#: Lines up to which a file counts as small.
SMALL = 50
COMMANDS = {
    "labrig run decay --rig sim": "from labrig.cli import guarded; "
    "guarded(['run', 'decay', '--rig', 'sim', '--runs', {runs!r}])",
    "labrig.process_run of a decay": "import labrig, glob; "
    "labrig.process_run(glob.glob({runs!r} + '/*')[0])",
}
COUNTED = "\nimport sys; print(sum(name.startswith('labrig.') for name in sys.modules))"


def product() -> Iterator[Path]:
    """Paths of the product's modules; links in `labrig` to the folders beside are left out."""
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            if path.resolve().relative_to(ROOT).parts[0] == folder:
                yield path


def code_lines(path: Path) -> int:
    """Number of lines with code, without comments and docstrings."""
    source = path.read_text(encoding="utf-8")
    documented: set[int] = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            first = node.body[0] if node.body else None
            if (
                isinstance(first, ast.Expr)
                and isinstance(first.value, ast.Constant)
                and isinstance(first.value.value, str)
            ):
                documented.update(range(first.lineno, (first.end_lineno or first.lineno) + 1))
    nothing = {
        tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT,
        tokenize.ENDMARKER,
    }  # fmt: skip
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type not in nothing:
            lines.update(range(token.start[0], token.end[0] + 1))
    return len(lines - documented)


def main() -> None:
    """Print the counts."""
    lines, files, small = Counter[str](), Counter[str](), 0
    for path in product():
        parts = path.relative_to(ROOT).parts
        package = "/".join(parts[:2]) if parts[0] == "labrig" and len(parts) > 2 else parts[0]
        n_lines = code_lines(path)
        lines[package] += n_lines
        files[package] += 1
        small += n_lines <= SMALL and path.name != "__init__.py"
    for package, n_lines in lines.most_common():
        print(f"{package:22} {n_lines:7} lines {files[package]:5} files")
    print(f"{'sum':22} {lines.total():7} lines {files.total():5} files, {small} of at most {SMALL}")
    with tempfile.TemporaryDirectory() as runs:
        for title, command in COMMANDS.items():
            words = [sys.executable, "-c", command.format(runs=runs) + COUNTED]
            done = subprocess.run(words, capture_output=True, text=True, check=True)
            print(f"modules of labrig loaded by {title}: {done.stdout.split()[-1]}")


if __name__ == "__main__":
    main()
