"""When a page is opened in a browser by itself, and when not."""

import sys
import webbrowser

import pytest
from truepath.browser import REMOTE, SCREENS, open_page, somebody_looks_on


@pytest.fixture
def at_the_screen(monkeypatch):
    """A terminal on a machine with a screen."""
    for name in (*REMOTE, *SCREENS):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)


def test_somebody_at_a_screen_looks_on(at_the_screen):
    assert somebody_looks_on()


@pytest.mark.parametrize("name", REMOTE)
def test_nobody_does_in_ci_or_far_away(at_the_screen, monkeypatch, name):
    monkeypatch.setenv(name, "true")
    assert not somebody_looks_on()


def test_nobody_does_where_output_goes_to_a_file(at_the_screen, monkeypatch):
    monkeypatch.setattr(sys.stdout, "isatty", lambda: False, raising=False)
    assert not somebody_looks_on()


@pytest.mark.parametrize(("platform", "looks_on"), [("linux", False), ("darwin", True), ("win32", True)])
def test_without_a_display_it_depends_on_the_system(at_the_screen, monkeypatch, platform, looks_on):
    monkeypatch.delenv("DISPLAY")
    monkeypatch.setattr(sys, "platform", platform)
    assert somebody_looks_on() == looks_on


def test_the_page_is_opened_by_its_address(monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr(webbrowser, "open", lambda address: asked.append(address) or True)
    assert open_page(tmp_path / "a page.html")
    assert asked == [f"file://{tmp_path}/a%20page.html"]


def test_without_a_browser_it_is_told(monkeypatch, tmp_path):
    def none(address):
        raise webbrowser.Error("could not locate runnable browser")

    monkeypatch.setattr(webbrowser, "open", none)
    assert not open_page(tmp_path / "page.html")
