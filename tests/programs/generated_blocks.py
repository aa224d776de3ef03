"""Assignments, branches and loops of generated programs, and what variables hold after them."""

from generated_moves import MoveWriter

CONDITIONS = (
    "get_digital_in(1)",
    "(get_standard_digital_in(2) == True)",
    "not get_digital_in(3)",
    "(read_input_float_register(1) > 0.5)",
    "get_digital_in(1) and (read_input_integer_register(0) < 3)",
    "(get_digital_in(4) or get_digital_in(5))",
)


class BlockWriter(MoveWriter):
    """Writes blocks of whatever ``statement`` there is."""

    def create(self):
        rng, stem = self.rng, self.rng.choice(("number", "pose", "pose", "joints", "poses"))
        name = self.fresh({"number": "x", "pose": "p", "joints": "q", "poses": "list"}[stem])
        if stem == "number":
            text, value = self.number(-0.02, 0.02, 3)
            if rng.random() < 0.15:
                text, value = "read_input_float_register(2)", None
        elif stem == "poses":
            text, value = self.listed([self.literal_pose() for _ in range(4)])
        else:
            text, value = self.pose() if stem == "pose" else self.literal_joints()
            if stem == "pose" and rng.random() < 0.12:
                text, value = "get_actual_tcp_pose()", None
        scope = rng.choice(("", "", "local " if self.in_function else "global "))
        self.put(f"{scope}{name}{self.equals}{text}")
        self.values[name], self.kinds[name] = value, stem
        if stem == "pose":
            self.assignable.add(name)

    def change(self):
        names = sorted(self.assignable & self.values.keys())
        if not names:
            return self.create()
        name = self.rng.choice(names)
        if self.values[name] is not None and self.rng.random() < 0.4:
            self.put(f"{name}[2]{self.equals}{name}[2] + 0.005")
            self.values[name] = [v + 0.005 if i == 2 else v for i, v in enumerate(self.values[name])]
        else:
            text, self.values[name] = self.literal_pose()
            self.put(f"{name}{self.equals}{text}")
        return None

    def block(self, length):
        self.level += 1
        for _ in range(length):
            self.statement()
        self.level -= 1

    def branch(self):
        before, ends = dict(self.values), []
        count = self.rng.randint(1, 3)
        closed = self.rng.random() < 0.5
        for k in range(count + closed):
            condition = self.rng.choice(CONDITIONS)
            head = "else:" if k == count else f"{'elif' if k else 'if'} {condition}:"
            self.put(head)
            self.values = dict(before)
            self.block(self.rng.randint(1, 3))
            ends.append(self.values)
        if not closed:
            ends.append(before)
        self.put("end")
        self.values = {n: ends[0][n] if all(e[n] == ends[0][n] for e in ends) else None for n in before}

    def sensed_loop(self):
        """Runs a number of times that nobody knows; some poses change in it from one turn to the next."""
        rng, outer = self.rng, self.assignable
        changing = sorted(outer & self.values.keys())
        changing = rng.sample(changing, min(len(changing), rng.randint(0, 2)))
        self.values |= dict.fromkeys(changing)
        before = dict(self.values)
        self.assignable = set(changing)
        self.put(f"while {rng.choice(CONDITIONS)}:")
        self.block(rng.randint(1, 4))
        self.level += 1
        if rng.random() < 0.3:
            self.put("if get_digital_in(6):")
            self.put(self.indent + "break")
            self.put("end")
        for name in changing:
            self.put(f"{name}{self.equals}{self.literal_pose()[0]}")
        self.level -= 1
        self.put("end")
        self.values, self.assignable = before, outer

    def counted_loop(self):
        counter, outer, before = self.fresh("i"), self.assignable, dict(self.values)
        self.assignable = set()
        self.put(f"{counter}{self.equals}0")
        self.put(f"while {counter} < 4:")
        self.values[counter], self.kinds[counter] = None, "counter"
        self.values[f"{counter}*1.0"], self.kinds[f"{counter}*1.0"] = None, "number"
        self.block(self.rng.randint(1, 3))
        self.level += 1
        self.put(f"{counter}{self.equals}{counter} + 1")
        self.level -= 1
        self.put("end")
        self.values, self.assignable = before, outer

    def doubtful_tool(self):
        """A tool that is set or not, a pose that nobody can place therefore, and certainty again."""
        self.put(f"if {self.rng.choice(CONDITIONS)}:")
        self.put(f"{self.indent}set_tcp({self.tool_text(self.new_tool())})")
        self.put("end")
        self.unresolved.append(self.put(f"movel({self.literal_pose()[0]}, a=1, v=0.1)"))
        self.set_tool()
