"""How tests read a report."""

import lxml.html

SECTIONS = ["accuracy", "findings", "left", "doubts", "residuals", "data", "parameters", "reading"]


def tree_of(page):
    return lxml.html.document_fromstring(page)


def text_of(page, place="body"):
    """What a reader reads in an element, with single spaces."""
    element = tree_of(page).xpath("//body" if place == "body" else f"//*[@id='{place}']")[0]
    for script in element.xpath(".//script|.//svg"):
        script.drop_tree()
    return " ".join(element.text_content().split())
