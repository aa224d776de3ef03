"""The page: it says what the summary says, loads nothing, and no file name can break into it."""

import json
import re
from html.parser import HTMLParser

import pytest
from chromium import headless
from small_programs import BY_SENSOR, NOTHING_MOVES, OUT_OF_REACH
from truepath.batch.page import MEANINGS, SIGNS, render
from truepath.batch.summary import STATUSES

SPREAD = {"mean": 0.5, "max": 1.25}
HELD_OUT = {"mean": 0.031, "p95": 0.052, "max": 0.064}


def entry(name="a.script", status="corrected", moved=SPREAD, **others):
    return {
        "program": name,
        "calibration": "c.json",
        "output": name,
        "result": f"{name}.json",
        "status": status,
        "message": "",
        "targets": 3,
        "corrected_targets": 3,
        "added_targets": 1,
        "unresolved": 0,
        "unresolved_lines": [],
        "displacement_mm": moved,
        "predicted_error_before_mm": moved,
        "predicted_error_after_mm": moved and {"mean": 1e-9, "max": 2e-9},
        "outside_calibrated_region": 0,
        "heldout_error_mm": HELD_OUT,
        "warnings": [],
        **others,
    }


def _sum(programs, name):
    return sum(each[name] for each in programs)


def summary(*programs):
    count = {status: sum(each["status"] == status for each in programs) for status in STATUSES}
    totals = {"programs": len(programs), **count, "resumed": 0, "targets": 3, "added_targets": 1, "unresolved": 0}
    totals.update(warnings=0, displacement_mm=SPREAD, predicted_error_before_mm=SPREAD, predicted_error_after_mm=None)
    outside, targets = (_sum(programs, name) for name in ("outside_calibrated_region", "corrected_targets"))
    totals.update(heldout_error_mm=HELD_OUT, outside_calibrated_region=outside, corrected_targets=targets)
    stamp = {"created_utc": "2026-11-22T12:00:00+00:00", "truepath": "0.4.0", "seconds": 75.0, "workers": 2}
    return {**stamp, "totals": totals, "left_over": [], "programs": list(programs)}


class Reader(HTMLParser):
    """Elements with their attributes, and text."""

    def __init__(self, page):
        super().__init__()
        self.elements, self.text = [], ""
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.text += data

    def all(self, tag):
        return [attrs for name, attrs in self.elements if name == tag]


def test_every_status_has_a_sign_of_its_own_and_a_meaning():
    assert set(SIGNS) == set(MEANINGS) == set(STATUSES)
    assert len(set(SIGNS.values())) == len(STATUSES)


def test_it_loads_nothing():
    page = render(summary(entry()))
    read = Reader(page)
    policy = next(
        meta["content"] for meta in read.all("meta") if "content" in meta and "default-src" in meta["content"]
    )
    assert policy.startswith("default-src 'none'")
    assert [tag for tag in ("link", "img", "iframe", "object") if read.all(tag)] == []
    assert [attrs for attrs in read.all("script") if "src" in attrs] == []
    assert all(a["href"].startswith("./") for a in read.all("a"))
    assert re.findall(r"https?://(?!www\.w3\.org)[^\"' ]+", page) == []


@pytest.mark.parametrize(
    "name", ["<script>alert(1)</script>.script", '"onmouseover="x.script', "a b&amp;ü%2f#?.script"]
)
def test_names_are_text_and_links_lead_to_the_file(name):
    read = Reader(render(summary(entry(name, message=name, warnings=[name]))))
    assert len(read.all("script")) == 1
    assert not any(attribute.startswith("on") for _, attrs in read.elements for attribute in attrs)
    assert name in read.text
    from urllib.parse import unquote

    assert unquote(read.all("a")[0]["href"]) == f"./{name}"
    assert "#" not in read.all("a")[0]["href"]
    assert "?" not in read.all("a")[0]["href"]


def test_the_rows_carry_what_is_sorted_by():
    read = Reader(render(summary(entry("a"), entry("b", "refused", None, output=None, message="too far"))))
    keys = [attrs["data-sort"] for tag, attrs in read.elements if tag in ("td", "th") and "data-sort" in attrs]
    assert keys[:10] == ["a", "corrected", "3", "1", "0", "0.5", "1.25", "0.5", "1.25", "0.031"]
    assert keys[11:22] == ["b", "refused", "3", "1", "0", "-1", "-1", "-1", "-1", "-1", "1"]
    assert "1 of 2 programs need a look: 0 partial, 1 refused, 0 failed" in read.text
    assert "1 min 15 s on 2 workers" in read.text


def cells(page, row):
    """Texts of the numbers of one program."""
    cut = page.split('<tr data-status="')[1 + row]
    return re.findall(r'<td class="number"[^>]*>(.*?)</td>', cut)


def test_what_to_expect_is_the_error_of_unseen_poses_and_not_that_of_the_solver():
    page = render(summary(entry("a"), entry("b", outside_calibrated_region=1), entry("c", outside_calibrated_region=3)))
    assert [cells(page, row)[7] for row in range(3)] == ["0.031", "0.031<small>not known at 1</small>", "not known"]
    after = page.split('<tr id="expected">')[1].split("</tr>")[0]
    assert re.findall(r'<td class="number">([^<]*)</td>', after) == ["0.031", "0.064"]
    assert "95 % within 0.052 mm" in page
    assert "4 targets lie outside the calibrated region" in page


def test_where_nobody_knows_no_number_is_told():
    without = summary(entry("a", heldout_error_mm=None))
    without["totals"]["heldout_error_mm"] = None
    beyond = summary(entry("a", outside_calibrated_region=3))
    for page in (render(without), render(beyond)):
        assert cells(page, 0)[7] == "not known"
        assert page.split('<tr id="expected">')[1].split("</tr>")[0].count("not known") == 2


def test_on_a_phone_the_reason_is_seen_without_scrolling_sideways(browser, tmp_path):
    reason = "the correction is larger than allowed " * 4
    page = render(summary(entry("a"), entry("b", "refused", None, output=None, message=reason)))
    (tmp_path / "p.html").write_text(page)
    page = browser.new_page(viewport={"width": 400, "height": 800})
    page.goto((tmp_path / "p.html").as_uri())
    assert page.evaluate("document.documentElement.scrollWidth") <= 400
    box = page.locator("#programs .remarks p").bounding_box()
    assert box["x"] >= 0
    assert 200 < box["width"] <= 400 - box["x"]
    page.close()


def test_nothing_moves():
    assert "No target of any program moves" in render(summary(entry(status="unchanged", moved=None)))


@pytest.fixture(scope="module")
def browser():
    with headless() as chromium:
        yield chromium


def test_a_person_can_sort_and_filter(batch, programs, calibration, browser):
    folder = programs(a=1, b=2, far=OUT_OF_REACH, seen=BY_SENSOR, still=NOTHING_MOVES)
    done = batch(folder, "-c", calibration)
    page = browser.new_page()
    seen = []
    page.on("request", lambda request: seen.append(request.url))
    page.on("console", lambda message: seen.append(message.text))
    page.on("pageerror", lambda error: seen.append(str(error)))
    address = (done.folder / "batch.html").as_uri()
    page.goto(address)

    def shown():
        rows = page.locator("#programs tbody tr:visible th").all_inner_texts()
        return [row.rsplit("/", 1)[1].removesuffix(".script") for row in rows]

    assert shown() == ["a", "b", "far", "seen", "still"]
    largest = {
        each["program"].rsplit("/", 1)[1].removesuffix(".script"): (each["displacement_mm"] or {"max": -1})["max"]
        for each in json.loads((done.folder / "batch.json").read_text())["programs"]
    }
    page.locator("#columns button").nth(6).click()
    assert shown() == sorted(largest, key=largest.__getitem__)
    assert page.locator("#columns th").nth(6).get_attribute("aria-sort") == "ascending"
    page.locator("#columns button").nth(6).click()
    assert shown() == sorted(largest, key=lambda name: -largest[name])
    page.locator("#controls input[value=corrected]").uncheck()
    assert sorted(shown()) == ["far", "seen", "still"]
    page.locator("#search").fill("OUT of reach")
    assert shown() == ["far"]
    assert page.locator("#shown").inner_text() == "1 of 5 shown"
    assert seen == [address]
    page.close()
