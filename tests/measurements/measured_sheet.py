"""A good data set of three poses as a sheet of text, for tests to spoil."""

from truepath.errors import InputError

JOINTS = [f"q{i}_rad" for i in range(1, 7)]
POSITION = ["x_mm", "y_mm", "z_mm"]
Q = [[0.1, -1.2, 1.3, -1.4, -1.5, 0.6], [0.2, -1.0, 1.1, -1.2, -1.3, 0.4], [-0.3, -0.9, 1.0, -1.1, -1.2, 0.3]]
P = [[100.5, -200.25, 300.0], [110.5, -210.25, 310.0], [120.5, -220.25, 320.0]]


class Sheet:
    """Columns of text under names: a good data set of three poses, for tests to spoil."""

    def __init__(self):
        self.columns = {name: [repr(row[i]) for row in Q] for i, name in enumerate(JOINTS)}
        self.columns |= {name: [repr(row[i]) for row in P] for i, name in enumerate(POSITION)}

    def add(self, **columns):
        self.columns |= {name: [str(cell) for cell in cells] for name, cells in columns.items()}
        return self

    def drop(self, *names):
        for name in names:
            del self.columns[name]
        return self

    def rename(self, **names):
        self.columns = {names.get(name, name): cells for name, cells in self.columns.items()}
        return self

    def set(self, name, line, cell):
        self.columns[name][line - 2] = cell
        return self

    def text(self):
        lines = [",".join(self.columns), *map(",".join, zip(*self.columns.values(), strict=True))]
        return "\n".join(lines) + "\n"


def place(error: InputError):
    return error.problem, error.line, error.column
