"""Networks in the calibration file: they come back to the last bit, and what makes no sense is refused."""

import copy
import hashlib
import json
from dataclasses import replace

import numpy as np
import pytest
from command import is_refused
from pydantic import ValidationError
from truepath import lie
from truepath.calibrate import calibrate
from truepath.calibration import Calibration, load_calibration
from truepath.calibration_residual import NetworkPart, ResidualPart
from truepath.describe import describe
from truepath.errors import InputError
from truepath.plants import models_dir
from truepath.residual.ensemble import NetworkResidual
from truepath.residual.network import Network
from truepath.residual.proof import Proof
from truepath.residual.reach import Reach


def residual_over(q_rad, outputs, seed=0):
    """Three networks of different size with random weights, for a robot measured at these joints."""
    rng, n = np.random.default_rng(seed), q_rad.shape[1]
    networks = [
        Network(rng.normal(size=(size, n + 1)), rng.normal(size=(outputs, size)), rng.normal(size=outputs))
        for size in (5, 8, 3)
    ]
    return NetworkResidual(tuple(networks), np.repeat([1e-4, 2e-4], 3)[:outputs], Reach.of(q_rad))


@pytest.fixture(scope="module")
def fit(real_ur5, clean):
    return calibrate(real_ur5.robot, clean.subset(np.arange(60)))


@pytest.fixture(scope="module")
def plain(real_ur5, clean, fit):
    """A calibration without networks."""
    return describe(real_ur5.robot, clean.subset(np.arange(60)), fit, "ur5", None)


@pytest.fixture(scope="module", params=[3, 6], ids=["3D", "6D"])
def calibration(request, real_ur5, clean, fit):
    """With networks."""
    model = replace(fit.model, residual=residual_over(clean.q_rad[:60], request.param))
    with_it = replace(fit, model=model)
    return describe(real_ur5.robot, clean.subset(np.arange(60)), with_it, "ur5", None, Proof(1e-9, 0.08, 0.04))


@pytest.fixture(scope="module")
def content(calibration):
    """JSON content of the file, without the checksum."""
    return {name: value for name, value in json.loads(calibration.to_json()).items() if name != "checksum"}


@pytest.fixture
def written(tmp_path):
    """Function: a file with that content and a checksum as somebody would write it who knows how."""

    def write(content):
        path = tmp_path / "calibration.json"
        canonical = json.dumps(content, sort_keys=True, separators=(",", ":"))
        path.write_text(json.dumps({**content, "checksum": hashlib.sha256(canonical.encode()).hexdigest()}))
        return path

    return write


# What comes back


def test_a_loaded_calibration_predicts_with_networks_to_the_last_bit_what_it_did_before(calibration, clean, tmp_path):
    calibration.save(tmp_path / "c.json")
    loaded = load_calibration(tmp_path / "c.json")
    assert loaded.residual == calibration.residual
    rng = np.random.default_rng(2)
    around = clean.q_rad[:60] + rng.uniform(-0.4, 0.4, (60, 6))
    for q in (clean.q_rad, around):
        np.testing.assert_array_equal(loaded.model.predict(q), calibration.model.predict(q))
        np.testing.assert_array_equal(loaded.model.residual.spread(q), calibration.model.residual.spread(q))
        np.testing.assert_array_equal(loaded.model.residual.weight(q), calibration.model.residual.weight(q))


def test_the_model_that_is_saved_is_the_model_that_was_fitted(calibration, fit, clean):
    fitted = replace(fit.model, residual=residual_over(clean.q_rad[:60], len(calibration.residual.scale)))
    np.testing.assert_array_equal(calibration.model.predict(clean.q_rad), fitted.predict(clean.q_rad))
    assert np.abs(fitted.predict(clean.q_rad) - fit.model.predict(clean.q_rad)).max() > 1e-5


def test_the_file_says_what_proved_the_networks(content):
    assert content["residual"]["proof"] == {"p_value": 1e-9, "before_mm": 0.08, "after_mm": 0.04}


def test_a_file_of_the_previous_version_that_knows_no_networks_still_loads(plain, written, clean):
    old = {name: value for name, value in json.loads(plain.to_json()).items() if name not in ("checksum", "residual")}
    loaded = load_calibration(written(old))
    assert loaded.residual is None
    assert loaded.model.residual is None
    np.testing.assert_array_equal(loaded.model.predict(clean.q_rad), plain.model.predict(clean.q_rad))


def test_another_payload_keeps_the_networks(calibration):
    assert calibration.carrying(2.0).residual == calibration.residual


# What is refused


def changed(content, path, value):
    """The content with one entry replaced, or with None taken away."""
    content = copy.deepcopy(content)
    *way, last = path
    place = content["residual"]
    for step in way:
        place = place[step]
    if value is None:
        del place[last]
    else:
        place[last] = value
    return content


NONSENSE = {
    "a weight that is no number": (("networks", 1, "hidden", 2, 0), float("nan")),
    "an infinite weight": (("networks", 0, "output", 0, 0), float("inf")),
    "a weight beyond all reason": (("networks", 0, "output", 0, 0), -1e30),
    "a threshold that is no number": (("networks", 0, "bias", 0), float("nan")),
    "a weight that is a word": (("networks", 0, "bias", 0), "0.5"),
    "a neuron with an input too few": (("networks", 0, "hidden", 1), [0.1] * 6),
    "a neuron with an input too many": (("networks", 0, "hidden", 1), [0.1] * 8),
    "a network without neurons": (("networks", 0, "hidden"), []),
    "neurons without inputs": (("networks", 0, "hidden"), [[]]),
    "neurons with nothing but a threshold": (("networks", 0, "hidden"), [[0.1]] * 5),
    "a network of another robot": (("networks", 0, "hidden"), [[0.1] * 8] * 5),
    "an output that hears a neuron too few": (("networks", 2, "output", 0), [0.1] * 2),
    "an output that hears a neuron too many": (("networks", 2, "output", 0), [0.1] * 4),
    "an output too few": (("networks", 0, "output"), [[0.1] * 5] * 2),
    "a threshold too few": (("networks", 0, "bias"), [0.1] * 2),
    "no network": (("networks",), []),
    "no outputs": (("networks",), [{"hidden": [[0.1] * 7], "output": [], "bias": []}]),
    "a scale too few": (("scale",), [1e-4] * 2),
    "scales for neither 3D nor 6D": (("scale",), [1e-4] * 4),
    "scales too many": (("scale",), [1e-4] * 7),
    "a scale of zero": (("scale", 0), 0.0),
    "a negative scale": (("scale", 1), -1e-4),
    "a scale that is no number": (("scale", 2), float("nan")),
    "a scale beyond all reason": (("scale", 0), 1e30),
    "a negative spacing": (("reach", "spacing"), -0.1),
    "no spacing at all": (("reach", "spacing"), 0.0),
    "a spacing without end": (("reach", "spacing"), float("inf")),
    "a median that is no number": (("reach", "median"), float("nan")),
    "a reach upside down": (("reach", "lower_rad", 0), 99.0),
    "a limit too few": (("reach", "upper_rad"), [1.0] * 5),
    "no poses": (("reach", "poses_rad"), []),
    "a pose with a joint too few": (("reach", "poses_rad", 3), [0.0] * 5),
    "a pose that is no number": (("reach", "poses_rad", 0, 0), float("nan")),
    "a pose that no robot takes": (("reach", "poses_rad", 0, 0), 1e200),
    "a limit that no robot has": (("reach", "upper_rad", 0), 1e300),
    "a probability above one": (("proof", "p_value"), 1.5),
    "a negative error": (("proof", "after_mm"), -0.1),
    "a proof by chance": (("proof", "p_value"), 0.9),
    "a proof of a loss": (("proof", "after_mm"), 99.0),
    "more neurons than anybody has taught": (("networks", 0, "hidden"), [[0.1] * 7] * 1001),
    "more networks than anybody has taught": (("networks",), [{"hidden": [[0.1] * 7]}] * 101),
    "a weight that no training reaches": (("networks", 0, "hidden", 0, 0), 1e7),
    "a residual of a metre": (("scale", 0), 1.0),
    "a spacing wider than an arm's range": (("reach", "spacing"), 100.0),
    "a probe that no flange carries": (("probe_m",), [0.0, 0.0, 1e3]),
    "without its proof": (("proof",), None),
    "without its reach": (("reach",), None),
    "something that nobody knows": (("surprise",), 1.0),
}


@pytest.mark.parametrize("kind", NONSENSE)
def test_networks_that_make_no_sense_are_refused(content, written, kind):
    path = written(changed(content, *NONSENSE[kind]))
    with pytest.raises(InputError, match="the calibration is not valid at residual") as caught:
        load_calibration(path)
    assert str(path) in str(caught.value)


def test_networks_for_a_robot_of_seven_joints_do_not_fit_one_of_six(content, written):
    seven = residual_over(np.random.default_rng(0).uniform(-1, 1, (40, 7)), 3)
    foreign = ResidualPart.of(seven, Proof(0.001, 0.1, 0.05)).model_dump()
    with pytest.raises(InputError, match="not for a robot with 6 joints"):
        load_calibration(written({**content, "residual": foreign}))


def test_with_a_network_changed_the_checksum_does_not_fit(content, calibration, tmp_path):
    text = calibration.to_json()
    number = repr(calibration.residual.networks[0].bias[0])
    path = tmp_path / "c.json"
    path.write_text(text.replace(number, "0.123"))
    with pytest.raises(InputError, match="changed after truepath wrote it"):
        load_calibration(path)


def test_no_calibration_with_broken_networks_can_be_made_in_the_first_place(calibration):
    broken = Network(np.full((2, 7), np.nan), np.zeros((3, 2)), np.zeros(3))
    with pytest.raises(ValidationError):
        NetworkPart.of(broken)
    with pytest.raises(ValidationError):
        Calibration.model_validate({**calibration.model_dump(by_alias=True), "residual": {}})


@pytest.mark.parametrize("kind", ["a weight that is no number", "a network of another robot", "a negative spacing"])
def test_broken_networks_end_the_command_with_exit_code_2_and_write_nothing(truepath, content, written, tmp_path, kind):
    path = written(changed(content, *NONSENSE[kind]))
    program = models_dir() / "ur5" / "weld_path.csv"
    outcome = truepath("correct", program, "-c", path, "-o", tmp_path / "out.csv")
    assert is_refused(outcome, "residual")
    assert not (tmp_path / "out.csv").exists()


@pytest.mark.parametrize("size", [1e3, 1e8, 1e12])
def test_with_weights_larger_than_a_robot_a_program_is_refused_not_corrected(
    truepath, content, written, tmp_path, size
):
    large = copy.deepcopy(content)
    large["residual"]["reach"]["spacing"] = 1e3
    for network in large["residual"]["networks"]:
        network["output"] = [[size * (-1) ** k for k in range(len(row))] for row in network["output"]]
    program = models_dir() / "ur5" / "weld_path.csv"
    outcome = truepath("correct", program, "-c", written(large), "-o", tmp_path / "out.csv")
    assert outcome.code == 2, outcome.err
    assert not (tmp_path / "out.csv").exists()


def test_after_another_probe_was_mounted_networks_turn_the_flange_as_before(fit, clean):
    """They learnt what turned about the old probe; where the new one sits makes no difference to the flange."""
    model = fit.model.with_residual(residual_over(clean.q_rad[:60], 6))
    moved = replace(model, X_FE=model.X_FE @ lie.make_pose(translation=np.array([0.1, -0.1, 0.2])))
    q = clean.q_rad[:20]
    assert np.abs(model.residual.shift(q)[:, 3:]).max() > 1e-5
    np.testing.assert_allclose(moved.flange_poses(q), model.flange_poses(q), rtol=0, atol=1e-12)
