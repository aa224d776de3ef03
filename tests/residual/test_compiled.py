"""What the kernels of an evolution are made of: a logistic function, chance, and machine code that may be kept."""

import shutil
import subprocess
import sys

import numba
import numpy as np
import pytest
from scipy.special import expit
from scipy.stats import kstest
from truepath.residual import compiled
from truepath.residual.evaluation import squared_misses


def logistic(z):
    """What a single neuron with output weight 1 says, by the kernel: the square root of what it misses zero by."""
    z = z.astype(np.float32)
    genes = np.stack([z, np.zeros_like(z), np.ones_like(z)], axis=1)[:, None, :]
    bias, sizes = np.zeros((len(z), 1), np.float32), np.ones(len(z), int)
    one_pose = np.ones((2, 1), np.float32)
    return np.sqrt(squared_misses(genes, bias, sizes, one_pose, np.zeros((1, 1), np.float32)).astype(float))


def test_the_logistic_function_is_wrong_by_as_little_as_is_said():
    z = np.r_[np.linspace(-40, 40, 200_001), 14.0 + np.linspace(-1e-3, 1e-3, 999), 1e30, -1e30].astype(np.float32)
    error = np.abs(logistic(z) - expit(z.astype(float)))
    squaring = np.finfo(np.float32).eps / 2  # what looking at the square of it adds
    assert error.max() < 7e-7 + squaring


def test_chance_is_that_of_splitmix64():
    """The first numbers from 1234567, as published with the generator (Rosetta Code has them in its test)."""
    published = [6457827717110365317, 3203168211198807973, 9817491932198370423, 4593380528125082431]
    found = [compiled._chance(np.uint64(1234567), number) for number in range(4)]
    assert found == [(value >> 11) / 2**53 for value in published]


def test_chance_of_neighbouring_seeds_is_even_and_independent():
    found = np.array([[compiled._chance(np.uint64(seed), number) for number in range(60)] for seed in range(60)])
    assert kstest(found.ravel(), "uniform").pvalue > 1e-3
    others = np.corrcoef(found)[~np.eye(60, dtype=bool)]
    assert np.abs(others).max() < 6 / np.sqrt(60)


def test_where_no_folder_can_be_written_it_is_compiled_all_the_same(monkeypatch):
    """numba says so when it is asked to keep what it compiles."""
    original = compiled.njit

    def without_a_folder(function, cache=False, **options):
        if cache:
            raise RuntimeError("cannot cache function: no locator available")
        return original(function, **options)

    monkeypatch.setattr(compiled, "njit", without_a_folder)
    assert compiled.compiled(lambda number: number + 1)(41) == 42


GENERATION = """
import numpy as np
from truepath.residual import compiled
from truepath.residual.evolution import evolve
from truepath.residual.limits import Settings

x = np.zeros((5, 6))
evolve(x, x[:, :3], Settings(3, 1, 2, generations=1), seed=0)
kernels = compiled.make_trials, compiled.misses(6, 3, np.float32), compiled.select
print(sum(sum(kernel.stats.cache_misses.values()) for kernel in kernels))
"""


def test_what_one_process_has_compiled_the_next_one_finds():
    """A kernel that refers to another one made at run time would be compiled anew, 4 s, and kept, each time."""
    command = [sys.executable, "-c", GENERATION]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    assert subprocess.run(command, check=True, capture_output=True, text=True).stdout.split() == ["0"]


def kept_kernels(folder, monkeypatch):
    """A quick kernel, as one process after the other compiles it or finds it on the disk."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(folder))
    return [compiled.compiled(doubled) for _ in range(2)]


def doubled(number):
    return 2 * number


@pytest.mark.parametrize("ending", ["nbc", "nbi"])
def test_spoilt_files_of_the_compiler_are_made_anew(tmp_path, monkeypatch, ending):
    first, second = kept_kernels(tmp_path, monkeypatch)
    assert first(21) == 42
    for path in tmp_path.rglob(f"*.{ending}"):
        path.write_bytes(path.read_bytes()[:40])
    assert second(21) == 42
    third = kept_kernels(tmp_path, monkeypatch)[0]
    assert third(21) == 42
    assert sum(third.stats.cache_hits.values()) == 1


def test_a_folder_that_goes_away_is_no_reason_to_fail(tmp_path, monkeypatch):
    kernel = kept_kernels(tmp_path / "there", monkeypatch)[0]
    shutil.rmtree(tmp_path / "there")
    (tmp_path / "there").write_text("now a file")
    assert kernel(21) == 42


def test_numba_is_loaded_when_networks_are_evaluated_and_no_sooner():
    code = "import sys, truepath.residual.evaluation; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
