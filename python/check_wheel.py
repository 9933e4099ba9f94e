"""Checks the size of a repaired wheel, and that it holds the notices of the libraries in it.

    python python/check_wheel.py WHEEL

Prints bytes packed and unpacked, and those of each shared library.
"""

from __future__ import annotations

import re
import sys
from zipfile import ZipFile

MOST_PACKED, MOST_OWN = 4_000_000, 1_500_000
# Its sections are aligned to pages of 64 KiB.
MOST_OWN_AARCH64 = 1_800_000
# For each library the file of LICENSES, and words of it that name the library.
NOTICES = {
    "box2d": ("MIT.txt", "Box2D: Copyright"),
    "bz2": ("bzip2.txt", "Julian"),
    "jpeg": ("libjpeg-turbo.txt", "libjpeg-turbo"),
    "lz4": ("BSD-2-Clause-LZ4.txt", "Yann Collet"),
    "png16": ("libpng-2.0.txt", "PNG Reference Library"),
    "sqlite3": ("README.md", "| public domain |"),
    "yaml": ("MIT.txt", "LibYAML: Copyright"),
    "zstd": ("BSD-3-Clause-Zstandard.txt", "Meta Platforms"),
}


def faults_of(wheel: ZipFile, packed: int, most_own: int) -> list[str]:
    """Prints the sizes; returns what is wrong."""
    sizes = {info.filename: info.file_size for info in wheel.infolist()}
    libraries = {name: size for name, size in sizes.items() if ".so" in name}
    print(f"packed {packed}, unpacked {sum(sizes.values())}; of it:")
    faults = []
    if packed > MOST_PACKED:
        faults.append(f"the wheel has {packed} bytes, expected up to {MOST_PACKED}")
    for name, size in sorted(libraries.items()):
        print(f"{size:9} {name}")
        if name.startswith("cairn2d/"):
            if size > most_own:
                faults.append(f"{name} has {size} bytes, expected up to {most_own}")
            continue
        found = re.search(r"/lib(\w+?)(-0)?-[0-9a-f]{8}\.so", name)
        library = found.group(1) if found else name
        if library not in NOTICES:
            faults.append(f"{name} has no notice, expected its licence in LICENSES")
            continue
        file, words = NOTICES[library]
        notice = [n for n in sizes if n.endswith(f"dist-info/licenses/LICENSES/{file}")]
        if not notice or words not in wheel.read(notice[0]).decode():
            faults.append(f'{name}: no "{words}" in {file} of the wheel')
    return faults


def main() -> int:
    """Checks the wheel."""
    path = sys.argv[1]
    with ZipFile(path) as wheel, open(path, "rb") as file:
        most_own = MOST_OWN_AARCH64 if "aarch64" in path else MOST_OWN
        faults = faults_of(wheel, file.seek(0, 2), most_own)
    for fault in faults:
        print(f"{path}: {fault}", file=sys.stderr)
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
