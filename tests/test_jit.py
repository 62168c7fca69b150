import os
import subprocess
import sys
from pathlib import Path

HELPER = "from gcodectl.jit import jit\n@jit\ndef add_kernel(x):\n    return x + {}\n"
CALLER = (
    "from gcodectl.jit import jit\nfrom helper import add_kernel\n@jit\ndef top_kernel(x):\n    return add_kernel(x)\n"
)


def run(folder: Path) -> str:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(folder), *sys.path])}
    command = "import caller; print(caller.top_kernel(1), sum(caller.top_kernel.stats.cache_hits.values()))"
    done = subprocess.run([sys.executable, "-c", command], env=environment, capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_a_changed_neighbour_makes_a_cached_kernel_stale(tmp_path: Path) -> None:
    folder = tmp_path / "package"
    folder.mkdir()
    (folder / "helper.py").write_text(HELPER.format(1))
    (folder / "caller.py").write_text(CALLER)
    assert run(folder) == "2 0"
    assert run(folder) == "2 1"
    (folder / "helper.py").write_text(HELPER.format(10))
    assert run(folder) == "11 0"
    assert run(folder) == "11 1"
