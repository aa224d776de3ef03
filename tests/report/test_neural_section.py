"""The section about the neural residual: what became of it, why, what it gains; nothing where nobody asked."""

from dataclasses import replace

import made_up
import numpy as np
import pytest
from reading import SECTIONS, text_of, tree_of
from truepath.networks_along import NetworksAlong
from truepath.report.canvas import AFTER, NETWORK
from truepath.report.drawn import Drawn
from truepath.report.network import said_over_found
from truepath.report.page import render
from truepath.report.words import significant
from truepath.residual.decision import Decision
from truepath.residual.proof import Proof

MINUS, TIMES = "\N{MINUS SIGN}", "\N{MULTIPLICATION SIGN}"


@pytest.fixture(scope="module")
def entered():
    return made_up.networked()


@pytest.fixture(scope="module")
def page(entered):
    return render(entered)


def plots_of(page):
    return tree_of(page).xpath("//*[@id='network']//svg/@aria-label")


def test_it_has_a_section_of_its_own_behind_the_findings(page):
    assert tree_of(page).xpath("//section/@id") == [*SECTIONS[:2], "network", *SECTIONS[2:]]
    assert "#network" in tree_of(page).xpath("//nav/a/@href")


def test_nobody_asked_nothing_is_said(rich_page):
    assert "network" not in text_of(rich_page).lower()


def test_what_became_of_it_why_and_what_it_gains(page):
    section = text_of(page, "network")
    assert f"In the model: it helps (p = 1.3 {TIMES} 10⁻⁸)." in section
    assert "0.0452 mm without it → 0.0404 mm with it: 0.0048 mm, 95 % interval 0.0021 to 0.0075 mm" in section
    assert f"p = 1 {TIMES} 10⁻⁸ that chance alone does as well" in section
    assert "not certain" not in section


def test_how_many_of_what_size_how_far_apart_and_where(entered, page):
    section, drawn = text_of(page, "network"), Drawn.of(entered)
    there = NetworksAlong.of(entered.network.model.residual, drawn.q_rad[drawn.unseen])
    assert "3 networks of 8 hidden neurons" in section
    assert f"{significant(np.median(there.spread_mm), 2)} mm (standard deviation) or less" in section
    full = int((~there.faded).sum())
    assert f"at {full} of {len(there.weight)} unseen poses" in section or full == len(there.weight)


def test_the_stage_is_in_the_strip_in_readable_words_and_in_its_own_colour(page):
    rows = tree_of(page).xpath("//table[contains(@class, 'stages')]/tbody/tr")
    assert rows[-1].xpath("./th")[0].text_content() == "+ neural residual"
    bars = [row.xpath(".//span[@class='bar']/@style")[0] for row in rows]
    assert NETWORK in bars[-1]
    assert AFTER in bars[-2]
    assert all(NETWORK not in bar for bar in bars[:-1])


def test_without_findings_the_networks_alone_have_theirs():
    page = render(made_up.networked(made_up.empty()))
    names = [th.text_content() for th in tree_of(page).xpath("//table[contains(@class, 'stages')]/tbody/tr/th")]
    assert names == ["Nominal", "Kinematic", "+ neural residual"]
    assert "Networks found something to learn" in text_of(page, "findings")


def test_what_the_networks_say_is_drawn_over_what_is_missed(page):
    assert len(plots_of(page)) == 3
    assert all("said by the networks, mm over missed without networks" in label for label in plots_of(page))


def test_networks_that_say_what_is_missed_predict_all_of_it(entered):
    drawn = Drawn.of(entered)
    knowing = drawn.error_B | {"network": np.zeros_like(drawn.error_B["final"])}
    captions = [plot.caption for plot in said_over_found(replace(drawn, error_B=knowing))]
    assert all(caption.startswith("the networks predict 100 % of the mean square miss") for caption in captions)


def test_the_distribution_of_errors_has_a_line_with_networks(page, rich_page):
    assert ", with networks " in text_of(page, "accuracy")
    assert "with networks" not in text_of(rich_page, "accuracy")


def test_errors_with_networks_are_those_of_the_model_with_its_shift_in_the_robot_base(entered):
    drawn = Drawn.of(entered)
    said = drawn.error_B["network"] - drawn.error_B["final"]
    np.testing.assert_allclose(said, 1e3 * entered.network.model.residual.shift(drawn.q_rad)[:, :3], atol=1e-9)


def test_what_is_left_is_said_to_be_about_the_model_without_them(page, rich_page):
    assert "with them the mean error is 0.0404 mm" in text_of(page, "left")
    assert "without networks" not in text_of(rich_page, "left")


def test_orientations_have_their_own_plots():
    labels = plots_of(render(made_up.networked(made_up.rich(60, six_d=True))))
    assert [("mrad" in label) for label in labels] == [False] * 3 + [True] * 3


def test_left_out_is_said_plainly_and_why():
    page = render(made_up.left_out())
    section = text_of(page, "network")
    assert "Left out: p = 0.31 does not prove a gain." in section
    assert "holds no networks" in section
    assert "were not tried on the" in section
    assert plots_of(page) == []
    assert "with networks" not in text_of(page, "accuracy")


def test_left_out_for_what_it_did_on_the_unseen_poses_comes_with_these_numbers():
    section = text_of(render(made_up.left_out(asked_unseen_poses=True)), "network")
    assert f"0.0452 mm without it → 0.0455 mm with it: {MINUS}0.0003 mm" in section
    assert "not certain" in section
    assert "holds no networks" in section


def test_too_few_poses_leave_no_numbers_to_state():
    few = Decision(Proof(1.0, 0.0, 0.0), None, None, "left out: there are too few poses to prove anything")
    section = text_of(render(replace(made_up.too_few(), network=few)), "network")
    assert "too few poses" in section
    assert "p = " not in section


def test_it_fits_on_a_telephone(browser, written, entered):
    tab = browser.new_page(viewport={"width": 390, "height": 900})
    tab.goto(written(entered).as_uri())
    assert tab.evaluate("document.documentElement.scrollWidth") <= 390
    tab.close()
