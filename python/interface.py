"""Writes the C source of the extension module cairn2d._cairn.

    interface.py SOURCES OUTPUT.c [sim]

The declarations are those of the headers: what the package uses of include/cairn, of the host
headers in HOST, and, with sim, of the simulated arenas. So the module never differs from the
library that it is built with.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import cffi

# Headers of the host library and of the programs' firmware loop beside include/cairn.
HOST = [
    "src/host/base/interruption.h",
    "src/host/maps/placed_scan.h",
    "src/host/maps/merged_map.h",
    "src/host/maps/capacity.h",
    "src/host/images/image_capacity.h",
    "src/host/logs/scan_log_correction.h",
    "src/host/logs/scan_table.h",
    "src/host/maps/scanner_check_run.h",
]
SIM = ["sim/outlines.h", "sim/arena.h"]

# Handlers of signals run at most so often during a long call of the host library: that takes the
# GIL.
SIGNAL_PERIOD_S = 0.05
SIGNAL_DECLARATIONS = """
extern "Python" int cairn2d_handle_signals(void);
void cairn2d_watch_signals(void);
"""
SIGNALS = f"""
static int cairn2d_handle_signals(void);

static double cairn2d_seconds(void)
{{
    struct timespec now;

    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}}

/* Returns 1 when a handler of signals has raised an exception in this thread. */
static int cairn2d_is_interrupted(void)
{{
    static _Thread_local double last;
    static _Thread_local int interrupted;
    double now = cairn2d_seconds();

    if (interrupted || now - last >= {SIGNAL_PERIOD_S}) {{
        last = now;
        interrupted = cairn2d_handle_signals();
    }}
    return interrupted;
}}

static void cairn2d_watch_signals(void)
{{
    cairn_interruption_set(cairn2d_is_interrupted);
}}
"""

# Headers of inline functions that call back, or of what an operating system lacks: not bound.
LEFT_OUT = {"output.h", "number_text.h", "json_text.h"}
WORD = re.compile(r"[A-Za-z_]\w*")
# Functions that the package calls by the name of a module.
CALLS_BY_MODULE = ("default", "check", "memory", "create", "map")


def without_bodies(text: str) -> str:
    """Replaces the bodies of inline functions by a semicolon."""
    out: list[str] = []
    position = 0
    for match in re.finditer(r"\b(static )?inline\b", text):
        if match.start() < position:
            continue
        opening = text.index("{", match.end())
        depth, end = 1, opening + 1
        while depth:
            depth += {"{": 1, "}": -1}.get(text[end], 0)
            end += 1
        out += [text[position : match.start()], text[match.end() : opening].rstrip(), ";\n"]
        position = end
    return "".join(out) + text[position:]


def constants(text: str) -> list[str]:
    """Names of the macros that are integers."""
    found = re.findall(r"^#define (CAIRN_[A-Z0-9_]+)[ \t]+(.+)$", text, re.M)
    integer = re.compile(r"\(?(INT(32|64)_C\()?[-0-9xXA-Fa-f]+\)?( ?<< ?[0-9]+)?\)?$")
    return [name for name, value in found if integer.match(value.strip())]


def declarations(text: str) -> str:
    """The declarations of a header as cffi reads them."""
    text = re.sub(r"/\*.*?\*/", "", text, flags=re.S)
    names = constants(text)
    text = re.sub(r"\\\n", " ", text)
    text = re.sub(r"^[ \t]*#.*$", "", text, flags=re.M)
    text = text.replace('extern "C" {', "")
    text = without_bodies(text)
    text = re.sub(r"\bCAIRN_(CHECKED|INLINED)\b", "", text)
    text = re.sub(r"\bCAIRN_\w+_FORMAT\([^)]*\)", "", text)
    text = re.sub(r"\b_Static_assert\([^;]*;", "", text)
    # Sizes and values that the compiler knows better.
    text = re.sub(r"\[[^\]\d]*[A-Z_+*][^\]]*\]", "[...]", text)
    text = re.sub(r"\[\.\.\.\](?=[,)])", "[]", text)
    text = re.sub(r"\b([A-Z][A-Z0-9_]*) = [^,}]*[A-Z_(][^,}]*", r"\1 = ...", text)
    # The brace that closes extern "C".
    text = re.sub(r"\n}\s*$", "\n", text)
    return "".join(f"#define {name} ...\n" for name in names) + text


def main() -> None:
    """Writes the source."""
    root, output, sim = Path(sys.argv[1]), Path(sys.argv[2]), "sim" in sys.argv[3:]
    headers = sorted(p for p in (root / "include/cairn").glob("*.h") if p.name not in LEFT_OUT)
    headers = in_order(headers) + [root / name for name in HOST + (SIM if sim else [])]
    text = "".join(declarations(p.read_text()) for p in headers)
    text = re.sub(r"typedef (float|double) cairn_real;", "", text)
    text = needed(text, package_words(Path(__file__).parent / "cairn2d"))
    builder = cffi.FFI()
    builder.cdef("typedef double cairn_real;\nvoid free(void *memory);\n" + text, override=True)
    includes = "".join(f'#include "{p.relative_to(root)}"\n' for p in headers)
    includes = "#include <stdlib.h>\n#include <time.h>\n" + includes.replace('"include/', '"')
    constant = f"#define CAIRN2D_SIM {int(sim)}\n"
    builder.set_source("cairn2d._cairn", includes + constant + SIGNALS)
    builder.cdef("#define CAIRN2D_SIM ...")
    builder.cdef(SIGNAL_DECLARATIONS)
    builder.emit_c_code(str(output))


def package_words(package: Path) -> set[str]:
    """Words of the package that may name declarations: those that it takes from the library."""
    words: set[str] = {"free"}
    for path in package.glob("*.py"):
        text = path.read_text()
        words |= set(WORD.findall(text))
        # Modules whose objects `_base` creates by name.
        by_name = r'(?:\b(?:create|new_params|checked)\(\s*|_module = )"(\w+)"'
        for module in re.findall(by_name, text):
            words |= {f"cairn_{module}_{call}" for call in CALLS_BY_MODULE}
            words |= {f"cairn_{module}", f"cairn_{module}_params"}
    return words


def statements(text: str) -> list[str]:
    """The declarations and constants of a text, one by one."""
    out, depth, begin = [], 0, 0
    for end, letter in enumerate(text):
        depth += {"{": 1, "}": -1}.get(letter, 0)
        if letter == ";" and depth == 0:
            out.append(text[begin : end + 1])
            begin = end + 1
    lines = [line for s in out for line in re.findall(r"^[ \t]*#.*$", s, re.M)]
    return lines + [re.sub(r"^[ \t]*#.*$", "", s, flags=re.M).strip() for s in out]


def declared(statement: str) -> set[str]:
    """The names that a declaration declares."""
    if statement.startswith("#"):
        return {statement.split()[1]}
    outside = re.sub(r"{.*}", " ", statement, flags=re.S)
    if not re.match(r"(typedef|struct|union|enum)\b", statement) or (
        "(" in outside and not statement.startswith("typedef")
    ):
        return set(re.findall(r"(\w+)\s*\(", outside)[:1]) or set(WORD.findall(outside)[-1:])
    names = set(re.findall(r"\b(?:struct|union|enum)\s+(\w+)", outside))
    names |= set(re.findall(r"\(\*(\w+)\)", outside)) or set(WORD.findall(outside)[-1:])
    if "enum" in outside:
        names |= set(re.findall(r"\b([A-Z][A-Z0-9_]*)\b", statement))
    return names


def needed(text: str, words: set[str]) -> str:
    """The declarations whose names are among the words, and those that they are made of."""
    every = statements(text)
    names = [declared(statement) for statement in every]
    words, kept = set(words), [False] * len(every)
    grows = True
    while grows:
        grows = False
        for i, statement in enumerate(every):
            if not kept[i] and names[i] & words:
                kept[i] = grows = True
                words |= set(WORD.findall(statement))
    return "\n".join(s for s, keep in zip(every, kept) if keep) + "\n"


def in_order(headers: list[Path]) -> list[Path]:
    """The headers, each behind those that it includes."""
    by_name = {f"cairn/{p.name}": p for p in headers}
    ordered: list[Path] = []

    def add(path: Path) -> None:
        if path in ordered:
            return
        for name in re.findall(r'^#include "(.+)"', path.read_text(), re.M):
            if name in by_name:
                add(by_name[name])
        if path not in ordered:
            ordered.append(path)

    for path in headers:
        add(path)
    return ordered


if __name__ == "__main__":
    main()
