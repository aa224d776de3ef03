"""Functions of generated programs, and calls of them."""

from dataclasses import dataclass

from generated_blocks import BlockWriter


@dataclass
class _Function:
    name: str
    tool: list
    parameter: tuple | None  # text and value that a call must pass; None for a function without parameters
    varied: bool = False  # called with different targets
    calls: int = 0
    moved_by: dict | None = None  # of one that is nothing but a move to its target: what each target is besides


class FunctionWriter(BlockWriter):
    """Writes functions: called once or often, with one target or several, or never."""

    def function(self, nested=False):
        """Defines one: called once or often, with one target or several, or never."""
        rng, outer = self.rng, (self.values, self.assignable, self.tool, self.in_function, self.is_run)
        way = rng.choice(("plain", "same", "varied", "never"))
        function = _Function(self.fresh("go"), self.new_tool(), None)
        self.tool, self.in_function = list(function.tool), True
        self.values, self.assignable = dict(self.constants), set()
        if nested:
            way, function.tool, self.tool = "plain", outer[2], outer[2]
        self.is_run = self.is_run and way != "never"
        target = self.fresh("target")
        if way in ("same", "varied"):
            function.parameter, function.varied = self.literal_pose(), way == "varied"
            self.values[target] = None if function.varied else function.parameter[1]
            self.kinds[target] = "pose"
        self.put(f"def {function.name}({target if function.parameter else ''}):")
        if function.varied:  # whoever looks into its target means it as it is: no literal may be changed
            self.put(f"{self.indent}{self.fresh('z')}{self.equals}{target}[2]")
        inner = None
        if not nested and rng.random() < 0.4:
            self.level += 1
            inner = self.function(nested=True)
            self.level -= 1
        self.block(rng.randint(1, 4))
        self.level += 1
        if inner:
            self.put(f"{inner.name}()")
        self.move()
        self.level -= 1
        self.put("end")
        self.values, self.assignable, self.tool, self.in_function, self.is_run = outer
        if not nested and way != "never":
            self.functions.append(function)
        return function

    def lift(self):
        name = self.fresh("lift")
        self.put(f"def {name}(where{self.comma}height):")
        self.put(f"{self.indent}return pose_add(where, p[0, 0, height, 0, 0, 0])")
        self.put("end")
        self.lifts.append(name)

    def tool_function(self):
        name, tool = self.fresh("use_tool"), self.new_tool()
        self.put(f"def {name}():")
        self.put(f"{self.indent}set_tcp({self.tool_text(tool)})")
        self.put("end")
        self.tool_functions.append((name, tool))

    def thread(self):
        name = self.fresh("watch")
        self.put(f"thread {name}():")
        self.put(f"{self.indent}while (True):")
        self.put(f"{2 * self.indent}set_digital_out(1, get_digital_in(2))")
        self.put(f"{2 * self.indent}sync()")
        self.put(f"{self.indent}end")
        self.put("end")
        self.put(f"{self.fresh('id')} = run {name}()")

    def wrapper(self):
        """Defines a function that moves to whatever target it is given, and does nothing else with it."""
        rng, function = self.rng, _Function(self.fresh("weld"), self.new_tool(), None, varied=True)
        target = self.fresh("seam")
        kind, name = rng.choice((("linear", "movel"), ("process", "movep"), ("joint", "movej")))
        stated = {"acceleration": round(rng.uniform(0.2, 1.4), 3), "speed": round(rng.uniform(0.01, 1.0), 4)}
        self.put(f"def {function.name}({target}):")
        self.put(f"{self.indent}set_digital_out(2, True)")
        goal = target
        if rng.random() < 0.3:
            goal = self.fresh("goal")
            self.put(f"{self.indent}local {goal}{self.equals}{target}")
        settings = f"a={stated['acceleration']}{self.comma}v={stated['speed']}"
        line = self.put(f"{self.indent}{name}({goal}{self.comma}{settings})")
        self.put("end")
        function.moved_by = {"kind": kind, "moved_by": line, **stated}
        self.functions.append(function)

    def call(self, function, parameter=None):
        if function.tool != self.tool:
            self.put(f"set_tcp({self.tool_text(function.tool)})")
            self.tool = list(function.tool)
        if function.moved_by is not None:
            self.targets.append(self.wrapped(function))
        elif function.varied:
            self.put(f"{function.name}({self.literal_pose()[0]})")
        else:
            self.put(f"{function.name}({'' if function.parameter is None else function.parameter[0]})")
        function.calls += 1

    def wrapped(self, function):
        """A call with a literal, or with a variable that holds one: the target is where the literal is."""
        (text, pose), name = self.literal_pose(), None
        if self.rng.random() < 0.3:
            name = self.fresh("w")
            line = self.put(f"{name}{self.equals}{text}")
        called = self.put(f"{function.name}({name or text})")
        return {"line": line if name else called, "pose": pose, "tool": list(function.tool), **function.moved_by}
