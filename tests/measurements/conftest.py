"""A sheet, and what reading it gives or how it is refused."""

import pytest
from measured_sheet import Sheet
from truepath.errors import InputError
from truepath.readers import read_measurements


@pytest.fixture
def sheet():
    return Sheet()


@pytest.fixture
def read(tmp_path, ur5):
    def read(content, robot=ur5):
        path = tmp_path / "poses.csv"
        text = content.text() if isinstance(content, Sheet) else content
        path.write_bytes(text.encode())
        return read_measurements(path, robot)

    return read


@pytest.fixture
def refusal(read):
    def refusal(content) -> InputError:
        with pytest.raises(InputError) as caught:
            read(content)
        assert "poses.csv" in str(caught.value)
        return caught.value

    return refusal
