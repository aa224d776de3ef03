"""A calibration, files with whatever stands in them, and how they are refused."""

import json

import pytest
from deviating_arm import described
from truepath.calibration import load_calibration
from truepath.errors import InputError


@pytest.fixture(scope="module")
def calibration(ur5):
    return described(ur5)[1]


@pytest.fixture(scope="module")
def text(calibration):
    return calibration.to_json()


@pytest.fixture
def file(tmp_path):
    """Writes text, bytes or an object to a file and returns its path."""

    def file(content):
        path = tmp_path / "calibration.json"
        if isinstance(content, dict):
            content = json.dumps(content)
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return file


@pytest.fixture
def refusal(file):
    def refusal(content, robot=None) -> InputError:
        path = file(content)
        with pytest.raises(InputError) as caught:
            load_calibration(path, robot)
        assert str(path) in str(caught.value)
        return caught.value

    return refusal
