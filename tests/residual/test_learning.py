"""From samples to networks: scaling, which poses stop the training, one network or an ensemble, always the same."""

import threading

import numpy as np
import pytest
from truepath.errors import InputError
from truepath.residual.learning import Lesson, Scaling, learn_ensemble, learn_for_each, learn_network, learn_networks
from truepath.residual.limits import Limits, Settings
from truepath.residual.options import Options, require_device
from truepath.residual.samples import Samples

QUICK = Settings(individuals=6, smallest=4, largest=8, generations=4)
OPTIONS = Options(evolution=QUICK, limits=Limits(30, 10), members=3)
MIDDLE = np.array([0.5, -1.0, 2.0])


def smooth(q):
    """What a robot leaves, 0.1 mm in size."""
    return 1e-4 * np.stack([np.sin(2 * q[:, 0] + q[:, 1]), np.cos(q[:, 1] - q[:, 2]), q[:, 0] * q[:, 2]], axis=1)


@pytest.fixture(scope="module")
def samples():
    rng = np.random.default_rng(0)
    q = MIDDLE + rng.uniform(-1, 1, (240, 3))
    return Samples(q, smooth(q) + 1e-5 * rng.normal(size=(240, 3)), np.arange(240))


def numbers(network):
    return np.concatenate([network.hidden.ravel(), network.output.ravel(), network.bias])


# Scaling


def test_positions_have_one_unit_and_turns_another(samples):
    turn = 1e-5 * np.random.default_rng(1).normal(size=(240, 3))
    scaling = Scaling.of(Samples(samples.q_rad, np.c_[samples.miss, turn], samples.visits))
    assert len(set(scaling.scale[:3])) == len(set(scaling.scale[3:])) == 1
    lesson = scaling.lesson(Samples(samples.q_rad, np.c_[samples.miss, turn], samples.visits), np.arange(40), 0)
    for kind in (lesson.target[:, :3], lesson.target[:, 3:]):
        assert np.sqrt(np.mean(kind**2)) == pytest.approx(1)
    assert np.abs(lesson.x).max() == pytest.approx(1)
    assert np.flatnonzero(lesson.validation).tolist() == list(range(40))


def test_a_model_that_leaves_nothing_is_no_trouble(samples):
    nothing = Samples(samples.q_rad, np.zeros((240, 3)), samples.visits)
    assert (np.abs(learn_ensemble(nothing, OPTIONS).shift(samples.q_rad)) < 1e-9).all()


# Ensembles


def test_an_ensemble_predicts_fresh_poses(samples):
    fresh = MIDDLE + np.random.default_rng(5).uniform(-0.9, 0.9, (500, 3))
    residual = learn_ensemble(samples, Options(evolution=QUICK, members=3))
    miss = np.linalg.norm(residual.shift(fresh)[:, :3] - smooth(fresh), axis=1)
    assert miss.mean() < 1e-5
    assert 0 < residual.spread(fresh).mean() < 1e-5


def test_each_member_leaves_out_other_poses_and_each_pose_is_left_out_once(samples, monkeypatch):
    lessons = []

    def remember(asked, *_):
        lessons.extend(asked)
        return [learn_network(lesson, OPTIONS) for lesson in asked]

    monkeypatch.setattr("truepath.residual.learning.learn_networks", remember)
    learn_ensemble(samples, OPTIONS)
    assert len(lessons) == 3
    assert (sum(lesson.validation.astype(int) for lesson in lessons) == 1).all()
    assert len({lesson.seed for lesson in lessons}) == 3


def test_visits_of_one_pose_are_left_out_together(samples, monkeypatch):
    lessons = []

    def remember(asked, *_):
        lessons.extend(asked)
        return [learn_network(lesson, OPTIONS) for lesson in asked]

    monkeypatch.setattr("truepath.residual.learning.learn_networks", remember)
    visits = np.arange(240) % 80
    repeated = Samples(samples.q_rad[visits], samples.miss[visits], visits)
    learn_ensemble(repeated, OPTIONS)
    learn_for_each([repeated, repeated], OPTIONS, "each")
    for lesson in lessons:
        for pose in range(80):
            assert len(set(lesson.validation[visits == pose])) == 1


def test_a_network_for_each_set_of_samples_knows_only_that_set(samples):
    halves = [samples.subset(np.arange(120)), samples.subset(np.arange(120, 240))]
    alone = learn_for_each(halves[:1], OPTIONS, "each")[0]
    both = learn_for_each(halves, OPTIONS, "each")
    np.testing.assert_array_equal(both[0].shift(samples.q_rad), alone.shift(samples.q_rad))
    assert [len(residual.networks) for residual in both] == [1, 1]
    assert np.abs(both[0].shift(samples.q_rad) - both[1].shift(samples.q_rad)).max() > 1e-7


# Chance and order


def test_the_same_seed_gives_the_same_bits_another_seed_others(samples):
    one, again, other = (
        learn_ensemble(samples, Options(evolution=QUICK, limits=Limits(10, 5), members=2, seed=seed))
        for seed in (3, 3, 4)
    )
    np.testing.assert_array_equal(one.shift(samples.q_rad), again.shift(samples.q_rad))
    assert np.abs(one.shift(samples.q_rad) - other.shift(samples.q_rad)).max() > 0


def test_networks_learnt_on_all_cores_are_those_learnt_one_after_the_other(samples):
    scaling = Scaling.of(samples)
    lessons = [scaling.lesson(samples, np.arange(k, 240, 6), seed=k) for k in range(5)]
    for together, lesson in zip(learn_networks(lessons, OPTIONS, "test"), lessons, strict=True):
        np.testing.assert_array_equal(numbers(together), numbers(learn_network(lesson, OPTIONS)))


def test_progress_tells_which_network_and_which_generation(samples):
    told = []
    learn_ensemble(samples, OPTIONS, "the title", told.append)
    first, *told = told
    assert first.startswith("the title: first generation")
    assert len(told) == 3 * QUICK.generations
    assert all(text.startswith("the title: network ") and " of 3, generation " in text for text in told)


# Interruption


@pytest.mark.parametrize("fault", [KeyboardInterrupt, InputError("no space left")], ids=["Ctrl-C", "a full disk"])
def test_what_stops_one_network_ends_the_others_soon_and_is_what_is_heard_of(samples, fault):
    """All evolutions are endless; the fault comes in whichever of them is the twentieth to report."""
    endless = Options(evolution=Settings(individuals=4, smallest=2, largest=3, generations=10**9, stagnation=10**9))
    lesson = Scaling.of(samples).lesson(samples, np.arange(40), 0)
    calls = []

    def interrupt(text):
        calls.append(text)
        if len(calls) == 20:
            raise fault

    before = threading.active_count()
    with pytest.raises(type(fault) if isinstance(fault, Exception) else fault):
        learn_networks([lesson] * 5, endless, "test", interrupt)
    assert threading.active_count() <= before + 1


# What is left of a measurement


def test_visits_are_counted_from_0_in_every_part(samples):
    part = Samples(samples.q_rad, samples.miss, np.arange(240) // 3).subset(np.arange(30, 90))
    assert sorted(set(part.visits)) == list(range(20))


def test_parts_joined_are_the_whole_again(samples):
    order = np.random.default_rng(0).permutation(240)
    rows = [order[:100], order[100:130], order[130:]]
    joined = Samples.joined([samples.subset(each) for each in rows], rows, samples.visits)
    for name in ("q_rad", "miss", "visits"):
        np.testing.assert_array_equal(getattr(joined, name), getattr(samples, name))


# Options


@pytest.mark.parametrize("wrong", [{"device": "tpu"}, {"seed": -1}, {"members": 1}], ids=str)
def test_options_that_make_no_sense_are_refused(wrong):
    with pytest.raises(InputError):
        Options(**wrong)


def test_a_gpu_that_is_not_there_is_refused(monkeypatch):
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    require_device("cpu")
    with pytest.raises(InputError, match="no CUDA device") as caught:
        require_device("cuda")
    assert "--device cpu" in str(caught.value)


def test_a_lesson_with_little_to_say_is_learnt_all_the_same():
    rng = np.random.default_rng(0)
    lesson = Lesson(rng.uniform(-1, 1, (30, 6)), rng.normal(size=(30, 3)), np.arange(30) < 5, 0)
    assert np.isfinite(numbers(learn_network(lesson, OPTIONS))).all()
