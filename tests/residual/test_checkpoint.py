"""A checkpoint goes on where a run was interrupted, to the last bit, and believes no file that is none."""

import json
from dataclasses import replace

import numpy as np
import pytest
from by_loop import random_network
from hypothesis import given
from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from signed_content import signed
from truepath.errors import InputError
from truepath.residual.checkpoint import SCHEMA, Checkpoint
from truepath.residual.learning import Lesson, learn_network, learn_networks
from truepath.residual.limits import Limits, Settings
from truepath.residual.options import Options

EVOLUTION = Settings(individuals=6, smallest=2, largest=6, generations=12, sizes_every=3)
OPTIONS = Options(evolution=EVOLUTION, limits=Limits(15, 10))


@pytest.fixture(scope="module")
def lesson():
    rng = np.random.default_rng(0)
    x = rng.uniform(-1, 1, (60, 4))
    return Lesson(x, np.sin(x[:, :3] + x[:, 1:]), np.arange(60) % 5 == 0, 7)


@pytest.fixture(scope="module")
def uninterrupted(lesson):
    return numbers(learn_network(lesson, OPTIONS))


def numbers(network):
    return np.concatenate([network.hidden.ravel(), network.output.ravel(), network.bias])


def interrupted_at(path, lesson, generation, options=OPTIONS):
    """Leaves a checkpoint as Ctrl-C does."""
    desk = Checkpoint(path)

    def report(state):
        if state.generation == generation + 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        learn_network(lesson, replace(options, checkpoint=desk), report)
    desk.save()


def resumed(path, lesson, options=OPTIONS):
    """The network, and the generations that it took from there."""
    generations = []
    with_desk = replace(options, checkpoint=Checkpoint(path))
    return learn_network(lesson, with_desk, lambda state: generations.append(state.generation)), generations


@pytest.fixture
def stopped(tmp_path, lesson):
    """A checkpoint left in generation 5."""
    path = tmp_path / "checkpoint.json"
    interrupted_at(path, lesson, 5)
    return path


# Going on


@pytest.mark.parametrize("generation", range(1, EVOLUTION.generations))
def test_interrupted_at_any_generation_the_network_is_bit_for_bit_that_of_an_undisturbed_run(
    tmp_path, lesson, uninterrupted, generation
):
    interrupted_at(tmp_path / "c.json", lesson, generation)
    network, generations = resumed(tmp_path / "c.json", lesson)
    np.testing.assert_array_equal(numbers(network), uninterrupted)
    assert generations == list(range(generation + 1, EVOLUTION.generations + 1))


def test_interrupted_again_and_again_it_still_ends_the_same(tmp_path, lesson, uninterrupted):
    for generation in (2, 3, 7, 11):
        interrupted_at(tmp_path / "c.json", lesson, generation)
    np.testing.assert_array_equal(numbers(resumed(tmp_path / "c.json", lesson)[0]), uninterrupted)


def test_a_finished_network_is_not_learnt_again(tmp_path, lesson, uninterrupted):
    resumed(tmp_path / "c.json", lesson)
    network, generations = resumed(tmp_path / "c.json", lesson)
    assert generations == []
    np.testing.assert_array_equal(numbers(network), uninterrupted)


def test_several_networks_go_on_each_where_it_was(tmp_path, lesson):
    lessons = [replace(lesson, seed=seed) for seed in range(4)]
    expected = [numbers(network) for network in learn_networks(lessons, OPTIONS, "t")]
    desk, calls = Checkpoint(tmp_path / "c.json"), []

    def interrupt(text):
        calls.append(text)
        if len(calls) == 30:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        learn_networks(lessons, replace(OPTIONS, checkpoint=desk), "t", interrupt)
    desk.save()
    content = json.loads((tmp_path / "c.json").read_text())
    assert content["finished"] or content["under_way"]
    found = learn_networks(lessons, replace(OPTIONS, checkpoint=Checkpoint(tmp_path / "c.json")), "t")
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(numbers(one), other)


# Whose entries these are


@pytest.mark.parametrize(
    "other",
    [
        lambda lesson, options: (replace(lesson, x=lesson.x + 1e-15), options),
        lambda lesson, options: (replace(lesson, target=lesson.target * (1 + 1e-15)), options),
        lambda lesson, options: (replace(lesson, validation=~lesson.validation), options),
        lambda lesson, options: (replace(lesson, seed=8), options),
        lambda lesson, options: (lesson, replace(options, evolution=replace(EVOLUTION, largest=7))),
        lambda lesson, options: (lesson, replace(options, evolution=replace(EVOLUTION, factor=0.4))),
        lambda lesson, options: (lesson, replace(options, limits=Limits(16, 10))),
    ],
    ids=["joints", "misses", "validation", "seed", "sizes", "factor", "training"],
)
def test_with_other_data_or_settings_nothing_is_taken_from_it_and_nothing_in_it_is_lost(stopped, lesson, other):
    before = json.loads(stopped.read_text())
    another, options = other(lesson, OPTIONS)
    network, generations = resumed(stopped, another, options)
    assert generations[0] == 1
    np.testing.assert_array_equal(numbers(network), numbers(learn_network(another, options)))
    after = json.loads(stopped.read_text())
    assert after["under_way"] == before["under_way"]
    assert len(after["finished"]) == len(before["finished"]) + 1


def test_the_file_says_what_it_is(stopped):
    content = json.loads(stopped.read_text())
    assert content["schema"] == SCHEMA == "truepath.evolution/2"
    assert [state["generation"] for state in content["under_way"].values()] == [5]


def test_when_all_is_done_nothing_is_left(stopped, lesson):
    desk = Checkpoint(stopped)
    learn_network(lesson, replace(OPTIONS, checkpoint=desk))
    assert stopped.exists()
    desk.remove()
    assert not stopped.exists()
    desk.remove()


def test_a_file_that_is_not_there_is_a_fresh_start(tmp_path, lesson, uninterrupted):
    np.testing.assert_array_equal(numbers(resumed(tmp_path / "new.json", lesson)[0]), uninterrupted)


# Hostile files


def test_a_file_that_is_no_checkpoint_is_refused_by_name(tmp_path):
    path = tmp_path / "other.json"
    schema = b'{"schema": "truepath.calibration/1"}'
    for content in (b"", b"{", b"null", b"[]", b"{}", schema, b"\xff\xfe", b"q1_rad,q2_rad\n0,0\n", b"[" * 100_000):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"other\.json: this is no checkpoint"):
            Checkpoint(path)
        assert path.read_bytes() == content


@pytest.mark.parametrize(
    "content",
    [
        {"schema": "truepath.evolution/3", "finished": {}, "under_way": {}},
        {"schema": SCHEMA, "finished": [], "under_way": {}},
        {"schema": SCHEMA, "finished": {}, "under_way": {}, "more": 1},
        {"schema": SCHEMA, "finished": {}},
        {"schema": SCHEMA, "finished": {"a": {"hidden": [[float("nan"), 1]], "output": [[1]], "bias": [1]}}},
    ],
)
def test_a_checksum_alone_makes_no_checkpoint(tmp_path, content):
    path = tmp_path / "other.json"
    path.write_text(json.dumps(signed(content)))
    with pytest.raises(InputError, match=r"other\.json: this is no checkpoint"):
        Checkpoint(path)


def test_a_folder_is_no_checkpoint(tmp_path):
    with pytest.raises(InputError, match="this is no checkpoint"):
        Checkpoint(tmp_path)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9, 0.999])
def test_a_file_that_was_cut_off_is_refused(stopped, share):
    whole = stopped.read_bytes()
    stopped.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(InputError, match=r"checkpoint\.json"):
        Checkpoint(stopped)


def _state(content):
    return next(iter(content["under_way"].values()))


def _network(inputs=4, neurons=3, outputs=3, size=1.0):
    network = random_network(np.random.default_rng(0), inputs, neurons, outputs, size)
    return {"hidden": network.hidden.tolist(), "output": network.output.tolist(), "bias": network.bias.tolist()}


SPOILT = {
    "an individual too few": lambda state: state["individuals"].pop(),
    "an error too few": lambda state: state["error"].pop(),
    "an individual too many": lambda state: state.update(
        individuals=[*state["individuals"], _network()], error=[*state["error"], 1.0]
    ),
    "no individuals": lambda state: state.update(individuals=[], error=[]),
    "an individual for other inputs": lambda state: state["individuals"].__setitem__(0, _network(inputs=6)),
    "an individual with other outputs": lambda state: state["individuals"].__setitem__(1, _network(outputs=6)),
    "an individual too large": lambda state: state["individuals"].__setitem__(2, _network(neurons=30)),
    "an individual too small": lambda state: state["individuals"].__setitem__(2, _network(neurons=1)),
    "a ragged individual": lambda state: state["individuals"][0]["hidden"][0].pop(),
    "weights that single precision does not know": lambda state: state["individuals"].__setitem__(
        0, _network(size=1e300)
    ),
    "a weight that is no number": lambda state: state["individuals"][0]["bias"].__setitem__(0, float("nan")),
    "an error that is no number": lambda state: state["error"].__setitem__(0, float("nan")),
    "an error that single precision does not know": lambda state: state["error"].__setitem__(0, 1e300),
    "an endless error": lambda state: state["error"].__setitem__(0, float("inf")),
    "a negative error": lambda state: state["error"].__setitem__(0, -1.0),
    "a generation after the last": lambda state: state.update(generation=EVOLUTION.generations + 1),
    "a negative generation": lambda state: state.update(generation=-1),
    "half a generation": lambda state: state.update(generation=1.5),
    "a negative count": lambda state: state.update(stale=-3),
    "a word for a number": lambda state: state.update(reference="low"),
    "something that nobody knows": lambda state: state.update(surprise=1),
}


@pytest.mark.parametrize("kind", SPOILT)
def test_an_evolution_that_makes_no_sense_is_refused_by_name(stopped, lesson, kind):
    content = json.loads(stopped.read_text())
    SPOILT[kind](_state(content))
    stopped.write_text(json.dumps(signed(content)))
    with pytest.raises(InputError, match=r"checkpoint\.json"):
        resumed(stopped, lesson)


@pytest.mark.parametrize(
    "network",
    [_network(inputs=6), _network(outputs=6), _network(size=1e300), _network(neurons=7)],
    ids=["inputs", "outputs", "huge", "neurons"],
)
def test_a_finished_network_that_cannot_be_one_of_these_is_refused_by_name(stopped, lesson, network):
    content = json.loads(stopped.read_text())
    key = next(iter(content["under_way"]))
    stopped.write_text(json.dumps(signed({**content, "finished": {key: network}, "under_way": {}})))
    with pytest.raises(InputError, match=r"checkpoint\.json"):
        resumed(stopped, lesson)


def test_a_number_that_was_changed_is_noticed(stopped, lesson):
    content = json.loads(stopped.read_text())
    _state(content)["individuals"][0]["bias"][0] += 1e-3
    stopped.write_text(json.dumps(content))
    with pytest.raises(InputError, match="its checksum is not that of its content"):
        resumed(stopped, lesson)


@pytest.fixture(scope="module")
def good(tmp_path_factory, lesson):
    path = tmp_path_factory.mktemp("good") / "checkpoint.json"
    interrupted_at(path, lesson, 3)
    return path


@hypothesis_settings(max_examples=60)
@given(data=st.data())
def test_however_a_file_is_spoilt_it_is_refused_or_it_is_still_a_checkpoint(good, lesson, spoilt, data):
    path = good.parent / "spoilt.json"
    path.write_bytes(data.draw(spoilt(good.read_bytes())))
    refused = None
    try:
        network, _ = resumed(path, lesson)
    except InputError as error:
        refused = str(error)
    assert "spoilt.json" in refused if refused else np.isfinite(numbers(network)).all()


def test_a_run_that_is_done_takes_only_its_own_entries_away(tmp_path, lesson):
    path, other = tmp_path / "both.json", replace(lesson, seed=8)
    for one in (other, lesson):
        desk = Checkpoint(path)
        learn_network(one, replace(OPTIONS, checkpoint=desk))
    desk.remove()
    assert Checkpoint(path).finished(Checkpoint.key(other, OPTIONS), other, OPTIONS) is not None
    assert Checkpoint(path).finished(Checkpoint.key(lesson, OPTIONS), lesson, OPTIONS) is None
