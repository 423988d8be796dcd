"""Build thud for Windows on Debian: an archive with the executable, and a wheel.

    python packaging/windows.py DIRECTORY

The wheel is for the version of Python that runs this script. Libraries are those of the wheels of
SciPy's OpenBLAS and of pyFFTW; the Python for Windows, whose headers the wheel needs and which
tests it under Wine, is an artifact of Maven.
"""

import re
import sys
import tempfile
import zipfile
from pathlib import Path
from shutil import copy2, copytree, ignore_patterns, make_archive, rmtree

from repair import add_licences, licence_files, run

ROOT = Path(__file__).parents[1]
BUILD = ROOT / "build/windows"
LIBRARIES = BUILD / "libraries"
PYTHON = BUILD / "python"
COMPILER = "x86_64-w64-mingw32"
TOOLCHAIN = f"--toolchain={ROOT / 'cmake/windows.cmake'}"
DEFINED = {"THUD_NATIVE": "OFF", "THUD_WINDOWS_LIBRARIES": LIBRARIES, "THUD_WINDOWS_PYTHON": PYTHON}
# Artifacts of Python by its version, and of the libraries of Microsoft that it needs.
PYTHONS = {
    "3.11": "3.11.3-1.5.9",
    "3.12": "3.12.1-1.5.10",
    "3.13": "3.13.5-1.5.12",
    "3.14": "3.14.3-1.5.13",
}
RUNTIME = "1.5.11"
# Packages of Debian whose libraries the linker adds, or stand in the wheel of pyFFTW.
OF_DEBIAN = ("gfortran-mingw-w64-x86-64-posix", "libfftw3-dev")
PARTS = ("libgfortran", "libgomp", "libquadmath")  # of the programs themselves


def unpack(archive: Path, pattern: str, target: Path) -> None:
    """Unpack the files of an archive that match a pattern; its group is their path in a folder."""
    with zipfile.ZipFile(archive) as files:
        for name in files.namelist():
            found = re.fullmatch(pattern, name)
            if found and not name.endswith("/"):
                path = target / found[1]
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_bytes(files.read(name))


def pip(command: str, *arguments: str | Path) -> None:
    """Run a command of pip for one package."""
    run(sys.executable, "-m", "pip", command, "--quiet", "--no-deps", *arguments)


def bring_wheel(package: str, pattern: str, target: Path) -> None:
    """Unpack files of the wheel of a package for Windows."""
    with tempfile.TemporaryDirectory() as place:
        pip("download", "--dest", place, "--platform=win_amd64", "--only-binary=:all:", package)
        (wheel,) = Path(place).iterdir()
        unpack(wheel, pattern, target)


def bring_artifact(name: str, version: str, pattern: str, target: Path) -> None:
    """Unpack files of an artifact of Maven for Windows."""
    artifact = f"org.bytedeco:{name}:{version}:jar:windows-x86_64"
    run("mvn", "-q", "-B", "dependency:get", "-Dtransitive=false", f"-Dartifact={artifact}")
    store = Path.home() / f".m2/repository/org/bytedeco/{name}/{version}"
    unpack(store / f"{name}-{version}-windows-x86_64.jar", pattern, target)


def bring_libraries() -> None:
    """Bring what thud is linked with, and Python."""
    openblas = r"[^/]*/(?:licenses/)?(lib/.*\.dll|LICENSE.txt)"
    bring_wheel("scipy-openblas32", openblas, LIBRARIES)
    bring_wheel("pyFFTW", r"pyfftw/(libfftw3-3.dll)", LIBRARIES / "lib")
    bring_wheel("numpy", r"numpy/_core/(include/.*)", LIBRARIES)
    copy2("/usr/include/fftw3.f03", LIBRARIES / "include")
    version = PYTHONS["{}.{}".format(*sys.version_info)]
    bring_artifact("cpython", version, r".*?windows-x86_64/(.+)", PYTHON)
    bring_artifact("javacpp", RUNTIME, r".*?windows-x86_64/(ucrtbase.dll|msvcp.*\.dll)", PYTHON)
    # SciPy's names of the functions have a prefix.
    library = LIBRARIES / "lib/libscipy_openblas.dll"
    names = sorted(set(re.findall(r"\bscipy_(\w+)\n", run(f"{COMPILER}-objdump", "-p", library))))
    exports = LIBRARIES / "openblas.def"
    exports.write_text("EXPORTS\n" + "".join(f"{name} == scipy_{name}\n" for name in names))
    given = ("-d", exports, "-D", library.name, "-l", library.with_name("libopenblas.dll.a"))
    run(f"{COMPILER}-dlltool", *given)


def licences() -> dict[str, list[Path]]:
    """Return the licences of what is bundled."""
    of_debian = {name: licence_files(name) for name in OF_DEBIAN}
    return of_debian | {"openblas": [LIBRARIES / "LICENSE.txt"]}


def make_program(name: str, target: Path) -> None:
    """Build the executable and its suites, and archive it with its libraries and the inputs."""
    program = BUILD / "program"
    defined = [f"-D{key}={value}" for key, value in DEFINED.items()]
    defined.append(f"-DPython_EXECUTABLE={sys.executable}")
    run("cmake", "-S", ROOT, "-B", program, "-G", "Ninja", TOOLCHAIN, *defined)
    run("cmake", "--build", program)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place, name)
        copytree(ROOT / "inputs", folder / "inputs", ignore=ignore_patterns("__pycache__"))
        for file in (program / "src/thud.exe", *LIBRARIES.glob("lib/*.dll"), ROOT / "LICENSE"):
            copy2(file, folder)
        for package, files in licences().items():
            (folder / "licenses" / package).mkdir(parents=True)
            for file in files:
                copy2(file, folder / "licenses" / package)
        make_archive(str(target / f"{name}-windows-x86_64"), "zip", place)


def make_wheel(target: Path) -> None:
    """Build the wheel with its libraries."""
    tool = (sys.executable, "-m", "wheel")
    tag = "cp{}{}".format(*sys.version_info)
    defined = {f"cmake.define.{key}": value for key, value in DEFINED.items()}
    settings = {"build-dir": BUILD / "wheel", "cmake.args": TOOLCHAIN} | defined
    given = [f"--config-settings={key}={value}" for key, value in settings.items()]
    with tempfile.TemporaryDirectory() as place:
        pip("wheel", "--no-build-isolation", "--wheel-dir", place, *given, ROOT)
        (wheel,) = Path(place).iterdir()
        tags = (f"--python-tag={tag}", f"--abi-tag={tag}", "--platform-tag=win_amd64")
        run(*tool, "tags", "--remove", *tags, wheel)
        (wheel,) = Path(place).iterdir()
        run(*tool, "unpack", "--dest", f"{place}/unpacked", wheel)
        (unpacked,) = Path(place, "unpacked").iterdir()
        names = [file.name for file in LIBRARIES.glob("lib/*.dll")]
        add_licences(unpacked, licences(), [*PARTS, *names])
        run(*tool, "pack", "--dest-dir", target, unpacked)


def main(directory: str) -> None:
    """Build all."""
    target = Path(directory).resolve()
    target.mkdir(parents=True, exist_ok=True)
    mark, python = BUILD / "brought", "{}.{}".format(*sys.version_info)
    if not mark.exists() or mark.read_text() != python:
        rmtree(BUILD, ignore_errors=True)
        bring_libraries()
        mark.write_text(python)
    (version,) = re.findall(r"version = '([0-9.]+)'", (ROOT / "src/base/constants.f90").read_text())
    make_program(f"thud-{version}", target)
    make_wheel(target)


if __name__ == "__main__":
    main(*sys.argv[1:])
