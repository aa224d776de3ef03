"""What the report promises: it says what the diagnosis says, opens anywhere, asks nobody, and cannot be broken into."""

import re
import subprocess
import sys
from dataclasses import replace

import made_up
import matplotlib
import pytest
from reading import SECTIONS, text_of, tree_of
from truepath.effects.outlier import EFFECT as OUTLIER
from truepath.errors import InputError
from truepath.report import write_report
from truepath.report.page import render


class TestItStandsAlone:
    def test_it_names_no_address_in_the_network(self, rich_page):
        assert not re.search(r"https?:|//www|@import", rich_page)

    def test_all_it_refers_to_is_in_the_page_or_beside_it(self, rich_page):
        ids = set(tree_of(rich_page).xpath("//@id"))
        references = re.findall(r'(?:href|src)="([^"]*)"|url\(([^)]*)\)', rich_page)
        for reference in (a or b for a, b in references):
            assert reference[1:] in ids if reference.startswith("#") else reference.startswith(("data:image/png", "./"))

    def test_no_two_elements_share_an_id(self, rich_page):
        ids = tree_of(rich_page).xpath("//@id")
        assert len(ids) == len(set(ids))

    def test_nothing_may_be_loaded_and_one_script_may_run(self, rich_page):
        policy = tree_of(rich_page).xpath("//meta[@http-equiv='Content-Security-Policy']/@content")[0]
        assert "default-src 'none'" in policy
        assert len(tree_of(rich_page).xpath("//script")) == 1

    def test_the_same_diagnosis_gives_the_same_file(self, rich, rich_page):
        assert render(rich) == rich_page


class TestItSaysWhatTheDiagnosisSays:
    @pytest.mark.parametrize("page", ["rich_page", "empty_page"])
    def test_all_sections_are_there(self, page, request):
        tree = tree_of(request.getfixturevalue(page))
        assert tree.xpath("//section/@id") == SECTIONS
        assert len(tree.xpath("//section/h2")) == len(SECTIONS)

    def test_the_verdict_comes_first(self, rich, rich_page):
        assert text_of(rich_page, "verdict") == rich.verdict

    def test_data_robot_date_software_and_hash(self, rich, rich_page):
        header, data = (
            " ".join(tree_of(rich_page).xpath("//header")[0].text_content().split()),
            text_of(rich_page, "data"),
        )
        for fact in ("cell_7_tracker.csv", "robot ur5", "200 poses (3D)", "2025-11-22", rich.measurements.sha256[:12]):
            assert fact in header
        assert rich.measurements.sha256 in data
        assert "drake 1.51.1" in data

    def test_every_stage_with_its_errors(self, rich, rich_page):
        rows = tree_of(rich_page).xpath("//table[contains(@class, 'stages')]/tbody/tr")
        assert len(rows) == len(rich.stages)
        for row, stage in zip(rows, rich.stages, strict=True):
            numbers = [float(cell.text_content()) for cell in row.xpath("./td")[:3]]
            errors = stage.accuracy.position_mm
            assert numbers == pytest.approx([errors.mean, errors.p95, errors.max], abs=5.1e-5)
        names = [row.xpath("./th")[0].text_content() for row in rows]
        assert names[:4] == ["Nominal", "Kinematic", "+ transmission error", "+ joint compliance"]

    def test_the_noise_floor(self, rich, rich_page):
        assert f"noise floor {rich.unexplained.noise_floor_mm:.4f}" in text_of(rich_page, "accuracy")

    def test_each_finding_has_its_card(self, rich, rich_page):
        for number, finding in enumerate(rich.findings, start=1):
            card = text_of(rich_page, f"finding-{number}")
            for text in (finding.cause[1:], finding.remedy[1:], *finding.summary):
                assert text in card
            assert f"{finding.gain.before_mm:.4f} → {finding.gain.after_mm:.4f} mm" in card

    def test_evidence_in_words(self, rich_page):
        waves, softness, drift = (text_of(rich_page, f"finding-{k}") for k in (1, 2, 3))
        assert "p < 10⁻¹²" in waves
        assert "odds of more than 10¹² to 1" in waves
        assert "p = 3 \N{MULTIPLICATION SIGN} 10⁻⁹" in softness
        assert "0.0081 mm, 95 % interval 0.0049 to 0.0113 mm" in softness
        assert "p = 0.0041" in drift
        assert "odds of 60 to 1" in drift

    def test_a_gain_that_may_be_none_is_called_uncertain(self, rich_page):
        assert "not certain" in text_of(rich_page, "finding-3")
        assert "not certain" not in text_of(rich_page, "finding-1")

    def test_parameters_of_a_finding_in_readable_units(self, rich, rich_page):
        rows = tree_of(rich_page).xpath("//*[@id='finding-1']//tbody/tr")
        assert len(rows) == len(rich.findings[0].parameters)
        assert [cell.text_content() for cell in rows[0]] == ["cos 1", "2", "130.0", "2.1", "µrad"]

    def test_parameters_of_the_kinematics_with_those_held(self, rich, rich_page):
        rows = tree_of(rich_page).xpath("//*[@id='parameters']//tbody/tr")
        held = [row.xpath("./th")[0].text_content() for row in rows if row.get("class") == "held"]
        assert len(rows) == len(rich.calibration.parameters)
        assert held == [p.name for p in rich.calibration.parameters if p.status == "held"]
        assert "the base frame can take its place" in text_of(rich_page, "parameters")

    def test_rows_left_out_by_number_and_line(self, rich, rich_page):
        rows = tree_of(rich_page).xpath("//*[@id='data']//tbody/tr")
        found = [(int(row[0].text_content()), int(row[1].text_content())) for row in rows]
        assert found == [(row, row + 1) for row in rich.to_dict()["data"]["outliers"]]
        assert OUTLIER.remedy[1:] in text_of(rich_page, "data")

    def test_doubts_with_the_poses_to_measure(self, rich, rich_page):
        doubts = tree_of(rich_page).xpath("//*[@id='doubts']")[0]
        assert doubts.xpath(".//a/@href") == ["./measure_next.csv"]
        assert "24 poses" in doubts.text_content()
        assert "check the tracker's scale or the temperature" in doubts.text_content()

    def test_what_could_not_be_tested_and_what_to_record(self, written):
        page = written(made_up.rich(60, context=False)).read_text(encoding="utf-8")
        columns = tree_of(page).xpath("//*[@id='doubts']//code/text()")
        assert columns == ["temperature_c", "t_s"]

    def test_what_is_left(self, rich_page, empty_page):
        assert "follows a pattern" in text_of(rich_page, "left")
        assert "three cycles per turn" in text_of(rich_page, "left")
        assert "no pattern" in text_of(empty_page, "left")
        assert "p = 0.43" in text_of(empty_page, "left")

    def test_nothing_found_is_said_calmly(self, empty_page):
        assert "No named cause passed the test" in text_of(empty_page, "findings")
        assert "before and after" not in text_of(empty_page, "residuals")

    def test_too_few_poses_to_judge_by(self, written):
        page = written(made_up.too_few()).read_text(encoding="utf-8")
        assert "Not known" in text_of(page, "left")
        assert tree_of(page).xpath("//section/@id") == SECTIONS
        assert not re.search(r"\bnan\b", text_of(page))


class TestPlots:
    def labels(self, page):
        return tree_of(page).xpath("//svg/@aria-label")

    def test_every_plot_says_what_it_shows(self, rich_page):
        plots = tree_of(rich_page).xpath("//svg")
        assert len(self.labels(rich_page)) == len(plots) > 20
        assert all(plot.get("role") == "img" and len(plot.get("aria-label")) > 40 for plot in plots)

    def test_time_temperature_joints_spectra_workspace_and_distribution(self, rich_page):
        labels = "\n".join(self.labels(rich_page))
        for part in (
            "over time since",
            "over temperature",
            "over angle",
            "Spectrum of joint 2",
            "from above",
            "from the side",
        ):
            assert part in labels
        assert "Position error on unseen poses" in labels

    def test_compliance_is_drawn_over_the_torque(self, rich_page):
        card = tree_of(rich_page).xpath("//*[@id='finding-2']//svg/@aria-label")
        assert len(card) == 1
        assert "gravity torque" in card[0]

    def test_a_wobbling_axis_is_seen_along_and_across_it(self, rich):
        wobble = replace(rich, findings=(replace(rich.findings[0], effect="axis_wobble", joints=(2,)),))
        labels = tree_of(render(wobble)).xpath("//*[@id='finding-1']//svg/@aria-label")
        assert [label.split(",")[1].strip() for label in labels] == [
            "across the axis",
            "across the axis",
            "along the axis",
        ]

    def test_without_a_clock_the_order_of_measurement_serves(self, empty_page):
        assert "Over the order of measurement" in text_of(empty_page, "residuals")
        assert "over temperature" not in "\n".join(self.labels(empty_page))

    def test_a_joint_that_moves_nothing_gets_a_sentence(self, rich_page):
        assert "joint 6 moves the probe too little" in text_of(rich_page, "residuals")

    def test_orientations_have_their_own(self):
        page = render(made_up.rich(60, six_d=True))
        assert len(tree_of(page).xpath("//table[contains(@class, 'stages')]")) == 2
        assert "Orientation error on unseen poses" in "\n".join(self.labels(page))

    def test_many_poses_make_no_large_file(self, written):
        assert written(made_up.rich(12_000)).stat().st_size < 4e6

    def test_matplotlib_stays_as_it_was(self, rich, monkeypatch):
        monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)  # importing it would fail
        settings = set(matplotlib.rcParams) - {"backend"}  # to look at it is to choose one
        before = {name: matplotlib.rcParams[name] for name in settings}
        render(rich)
        assert {name: matplotlib.rcParams[name] for name in settings} == before


def test_no_text_breaks_out(unkind_file):
    tree = tree_of(unkind_file.read_text(encoding="utf-8"))
    assert len(tree.xpath("//script")) == 1
    assert not tree.xpath("//b")
    assert tree.xpath("//h1")[0].text_content() == made_up.UNKIND
    assert tree.xpath("//*[@id='verdict']")[0].text_content() == made_up.UNKIND
    links = tree.xpath("//a/@href")
    assert all(link.startswith(("#", "./")) for link in links)


def test_a_report_is_written_as_a_whole_or_not_at_all(rich, tmp_path):
    with pytest.raises(InputError, match="cannot write here"):
        write_report(tmp_path / "missing" / "report.html", rich)
    assert not list(tmp_path.iterdir())


def test_heavy_imports_wait_until_a_report_is_written():
    code = "import sys, truepath.report; print([m for m in ('matplotlib', 'jinja2', 'casadi') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


class TestInABrowser:
    @pytest.fixture(params=[1280, 390])
    def width(self, request):
        return request.param

    def opened(self, browser, file, width):
        tab = browser.new_page(viewport={"width": width, "height": 900})
        requests, complaints = [], []
        tab.on("request", lambda request: requests.append(request.url))
        tab.on("pageerror", lambda error: complaints.append(str(error)))
        tab.on("console", lambda message: complaints.append(message.text))
        tab.goto(file.as_uri())
        return tab, [url for url in requests if not url.startswith("data:")], complaints

    def test_it_asks_for_nothing_complains_of_nothing_and_fits(self, browser, rich_file, width):
        tab, requests, complaints = self.opened(browser, rich_file, width)
        assert requests == [rich_file.as_uri()]
        assert complaints == []
        assert tab.evaluate("document.documentElement.scrollWidth") <= width
        tab.close()

    def test_unkind_names_do_no_harm(self, browser, unkind_file, width):
        tab, requests, complaints = self.opened(browser, unkind_file, width)
        assert tab.title().endswith(made_up.UNKIND)
        assert requests == [unkind_file.as_uri()]
        assert complaints == []
        assert tab.evaluate("document.documentElement.scrollWidth") <= width
        tab.close()

    def test_plots_have_a_size_and_text_is_legible(self, browser, rich_file, width):
        tab, _, _ = self.opened(browser, rich_file, width)
        sizes = tab.evaluate("[...document.querySelectorAll('svg')].map(s => s.getBoundingClientRect().width)")
        assert min(sizes) > 280
        tab.close()

    def test_details_are_open_on_paper_only(self, browser, rich_file):
        tab, _, _ = self.opened(browser, rich_file, 1280)
        open_ones = "document.querySelectorAll('details[open]').length"
        assert tab.evaluate(open_ones) == 0
        tab.evaluate("dispatchEvent(new Event('beforeprint'))")
        assert tab.evaluate(open_ones) == 4
        tab.evaluate("dispatchEvent(new Event('afterprint'))")
        assert tab.evaluate(open_ones) == 0
        tab.close()
