"""Bundle the system libraries that a wheel needs, with their licences.

    python packaging/repair.py WHEEL DIRECTORY

auditwheel copies the libraries and names the packages of the system that they are from in its list
of materials (``sboms/auditwheel.cdx.json``); the licences are those of these packages.
"""

import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

# Licences of the libraries that may be bundled, by the beginnings of their names.
LICENCES = {
    "libblas": "BSD-3-Clause",
    "liblapack": "BSD-3-Clause",
    "libopenblas": "BSD-3-Clause",
    "libscipy_openblas": "BSD-3-Clause",
    "libfftw3": "GPL-2.0-or-later",
    "libgfortran": "GPL-3.0-or-later WITH GCC-exception-3.1",
    "libgomp": "GPL-3.0-or-later WITH GCC-exception-3.1",
    "libquadmath": "LGPL-2.1-or-later",
}


def run(*command: str | Path) -> str:
    """Return what a command prints."""
    done = subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True)
    return done.stdout


def licence_files(package: str) -> list[Path]:
    """Return the licences of a package of the system, Debian's or Red Hat's."""
    copyright_file = Path("/usr/share/doc", package, "copyright")
    if not copyright_file.exists():
        return [Path(line) for line in run("rpm", "--query", "--licensefiles", package).split()]
    named = re.findall(
        r"/usr/share/common-licenses/[\w.-]*\w", copyright_file.read_text(encoding="utf-8")
    )
    return [copyright_file, *sorted({Path(name).resolve() for name in named})]


def licence_of(library: str) -> str:
    """Return the SPDX expression of a bundled library."""
    for name, licence in LICENCES.items():
        if library.startswith(name):
            return licence
    message = f"packaging/repair.py knows no licence of {library}"
    raise SystemExit(message)


def bundled(wheel: Path) -> dict[str, list[Path]]:
    """Return the licences of the packages whose libraries auditwheel has added, by their names."""
    (materials,) = wheel.glob("*.dist-info/sboms/auditwheel.cdx.json")
    parts = json.loads(materials.read_text(encoding="utf-8"))["components"]
    return {
        name: licence_files(name) for name in {part["name"] for part in parts} - {"thud_acoustics"}
    }


def add_licences(
    wheel: Path, licences: Mapping[str, Sequence[Path]], libraries: Iterable[str]
) -> None:
    """Add the licences of packages to an unpacked wheel, and state those of bundled libraries."""
    (information,) = wheel.glob("*.dist-info")
    headers = []
    for package, files in sorted(licences.items()):
        if not files:
            message = f"the package {package} has no licence"
            raise SystemExit(message)
        for file in files:
            name = Path("bundled", package, file.name)
            target = information / "licenses" / name
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_bytes(file.read_bytes())
            headers.append(f"License-File: {name}\n")
    found = {licence_of(name) for name in libraries} - {"BSD-3-Clause"}
    metadata = information / "METADATA"
    text, count = re.subn(
        r"^(License-Expression: BSD-3-Clause)\n",
        rf"\1 AND {' AND '.join(sorted(found))}\n{''.join(headers)}",
        metadata.read_text(encoding="utf-8"),
        count=1,
        flags=re.MULTILINE,
    )
    if count == 0:
        message = "the wheel does not state the licence of thud"
        raise SystemExit(message)
    metadata.write_text(text, encoding="utf-8")


def main(wheel: str, directory: str) -> None:
    """Repair a wheel."""
    with tempfile.TemporaryDirectory() as place:
        tool = (sys.executable, "-m", "wheel")
        run("auditwheel", "repair", "--wheel-dir", f"{place}/repaired", wheel)
        (repaired,) = Path(place, "repaired").iterdir()
        run(*tool, "unpack", "--dest", f"{place}/unpacked", repaired)
        (unpacked,) = Path(place, "unpacked").iterdir()
        (folder,) = unpacked.glob("*.libs")
        add_licences(unpacked, bundled(unpacked), [file.name for file in folder.iterdir()])
        Path(directory).mkdir(parents=True, exist_ok=True)
        print(run(*tool, "pack", "--dest-dir", directory, unpacked), end="")


if __name__ == "__main__":
    main(*sys.argv[1:])
