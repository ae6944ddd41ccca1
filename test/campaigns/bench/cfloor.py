"""The floor of the ping-pong: a small C program on the wheels' own rcl, built here where a C compiler is present."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from importlib import resources
from pathlib import Path

SOURCE = "pingpong.c"
PACKAGES = ("sensor_msgs", "geometry_msgs", "std_msgs", "nav_msgs", "rosgraph_msgs", "builtin_interfaces")
LIBRARIES = ("rcl", "rcutils", "rmw", "rosidl_runtime_c")


def build(folder: Path) -> tuple[Path | None, str]:
    """Compile the program into `folder`; return the library, or None and the reason in one line."""
    compiler = next((found for name in (os.environ.get("CC", ""), "cc", "gcc", "clang") if (found := _find(name))), "")
    if not compiler:
        return None, "no C compiler"
    prefix = Path(sys.prefix)
    headers = sorted(path for path in (prefix / "include").glob("*") if path.is_dir())
    if not (prefix / "include" / "rcl").is_dir():
        return None, f"no rcl headers under {prefix.name}/include"
    source, library = folder / SOURCE, folder / "libpingpong.so"
    source.write_text((resources.files("test.campaigns.bench") / SOURCE).read_text(encoding="utf-8"), encoding="utf-8")
    messages = [f"{package}__{part}" for package in PACKAGES for part in ("rosidl_typesupport_c", "rosidl_generator_c")]
    command = [compiler, "-O2", "-fPIC", "-shared", str(source), "-o", str(library)]
    command += [f"-I{path}" for path in headers]
    command += [f"-L{prefix / 'lib'}", *(f"-l{name}" for name in (*LIBRARIES, *messages))]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0 or not library.is_file():
        return None, f"{Path(compiler).name} failed: {(done.stderr.strip().splitlines() or ['no output'])[-1]}"
    return library, ""


def _find(name: str) -> str | None:
    return shutil.which(name) if name else None


def main(argv: list[str] | None = None) -> int:
    """Run the built library's program: ``<library> answer`` or ``<library> ask <rounds> <warm-up>``."""
    library, *words = sys.argv[1:] if argv is None else argv
    program = ctypes.CDLL(library).pingpong_main
    arguments = [b"pingpong", *(word.encode() for word in words)]
    return int(program(len(arguments), (ctypes.c_char_p * len(arguments))(*arguments)))


if __name__ == "__main__":
    sys.exit(main())
