import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from repaint_cli.envs.racer.device import card
from repaint_cli.envs.racer.device.noise import normal
from repaint_cli.envs.racer.dynamics.race import RaceRules
from repaint_cli.envs.racer.env import RacerVectorEnv
from repaint_cli.envs.racer.sight.appearance import RandomAppearance
from repaint_cli.envs.racer.sight.noise import Noise
from repaint_cli.envs.racer.track.files import load_track
from repaint_cli.errors import CardError, DeviceError

FIXTURES = Path(__file__).parent / "fixtures"
ROOT = Path(__file__).parents[1]
KERNELS = {
    "choose_listed", "choose_ranged", "put_starts", "drive_cars", "drive_objects", "meet_objects",
    "judge_cars", "report_cars", "view_boxes", "draw_pictures", "scan_ranges",
}  # fmt: skip


def run(script, *words, **env):
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, str(FIXTURES / script), *words],
        env={**os.environ, "PYTHONPATH": path, **env}, capture_output=True, text=True, check=False,
    )  # fmt: skip


SIMULATED = {"NUMBA_ENABLE_CUDASIM": "1", "NUMBA_DISABLE_JIT": "1"}


def test_the_simulated_gpu_begins_and_ends_episodes_as_the_cpu():
    done = run("simulated_gpu.py", "a step an episode", **SIMULATED)
    assert done.stdout == "equal\n", done.stderr


@pytest.mark.slow
def test_the_simulated_gpu_drives_and_sees_as_the_cpu_bit_for_bit():
    done = run("simulated_gpu.py", **SIMULATED)
    assert done.stdout == "equal\n", done.stderr


@pytest.mark.skipif(find_spec("numba_cuda") is None, reason="numba-cuda is not installed")
def test_every_kernel_compiles_for_an_h100_and_none_spills():
    done = run("compile_kernels.py")
    if "libNVVM" in done.stderr or "DynamicLibNotFoundError" in done.stderr:
        pytest.skip("CUDA's compiler is not installed")
    assert done.returncode == 0, done.stderr
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    assert {line["kernel"] for line in lines} == KERNELS
    if "spills" not in lines[0]:
        pytest.skip("ptxas is not installed: only the PTX was made")
    assert not [line for line in lines if line["spills"]]
    assert max(line["registers"] for line in lines) <= 128


@pytest.mark.parametrize(
    ("settings", "found"),
    [
        ({"noise": Noise()}, "noise in actions and pictures"),
        ({"appearance": RandomAppearance(0.1)}, "random light or colours"),
        ({"race": RaceRules()}, "races of several laps"),
    ],
)
def test_what_only_the_cpu_does_is_refused(settings, found):
    with pytest.raises(CardError, match=f"expected what a GPU can drive, found {found}; or leave"):
        RacerVectorEnv(load_track("oval"), 2, device="cuda", **settings)


def test_several_tracks_are_refused():
    with pytest.raises(CardError, match="found several tracks; or leave the device out"):
        RacerVectorEnv([load_track("oval"), load_track("wide-loop")], 2, device="cuda")


def test_reward_functions_are_for_the_cpu():
    env = RacerVectorEnv(load_track("oval"), 1)
    env.on_device = object()
    with pytest.raises(
        CardError, match=r"expected cars on the CPU for params, .* on a GPU; or leave"
    ):
        env.params(0)


def test_an_unknown_device_is_named():
    with pytest.raises(ValueError, match="unknown device 'tpu'; choose one of cpu, cuda"):
        RacerVectorEnv(load_track("oval"), 2, device="tpu")


def test_without_numba_cuda_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr(card, "find_spec", lambda name: None)
    with pytest.raises(DeviceError, match=r"found none; pip install 'numba-cuda.cu13.' brings it"):
        RacerVectorEnv(load_track("oval"), 2, device="cuda")


def test_without_a_gpu_it_says_why(monkeypatch):
    cuda = pytest.importorskip("numba.cuda")
    if cuda.is_available():
        pytest.skip("there is a GPU")
    monkeypatch.setattr(card, "find_spec", lambda name: name)
    with pytest.raises(DeviceError, match=r"found none \(.+\); see what nvidia-smi says, or leave"):
        RacerVectorEnv(load_track("oval"), 2, device="cuda")


def test_a_driver_may_be_newer_but_not_older():
    card.check_versions((13, 0), (13, 4))
    card.check_versions((14, 1), (13, 0))
    with pytest.raises(DeviceError, match=r"expected a driver for CUDA 13 .* found one for 12\.4"):
        card.check_versions((12, 4), (13, 0))


def test_a_card_that_is_too_small_says_how_many_cars_fit():
    card.check_free(1000, 1000, 10)
    words = r"expected 8,000 bytes free on the GPU for 16 cars, found 2,000; .* \(about 4 fit\)"
    with pytest.raises(DeviceError, match=words):
        card.check_free(8000, 2000, 16)


def test_noise_of_ranges_is_normal_and_differs_by_car_and_place():
    keys = np.arange(40, dtype=np.uint64)
    drawn = np.array([[normal(key, place) for place in range(500)] for key in keys])
    assert len(np.unique(drawn)) == drawn.size
    assert abs(drawn.mean()) < 0.03
    assert abs(drawn.std() - 1) < 0.03
    assert abs((drawn**4).mean() - 3) < 0.2
    assert np.abs(np.corrcoef(drawn) - np.eye(40)).max() < 0.25
    assert normal(keys[3], 7) == drawn[3, 7]
