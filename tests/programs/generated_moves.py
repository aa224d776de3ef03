"""Moves of generated programs, the tool that they are made with, and their targets."""

from generated_expressions import ExpressionWriter


class MoveWriter(ExpressionWriter):
    """Writes a move and records its targets, or that it has none that all runs agree on."""

    def move(self):
        rng = self.rng
        kind = rng.choice(("movej", "movej", "movel", "movel", "movel", "movep", "movec", "servoj"))
        where = []  # text, value, the key that it is recorded under, near
        if kind == "servoj" or (kind == "movej" and rng.random() < 0.6) or rng.random() < 0.1:
            text, value = self.joints()
            where.append((text, value, "joints", None))
        else:
            text, value = self.pose()
            near = None
            if kind == "movej" and rng.random() < 0.6:
                near_text, near = self.literal_joints()
                text = f"get_inverse_kin({text}{self.comma}{rng.choice(('', 'qnear='))}{near_text})"
            where.append((text, value, "pose", near))
        if kind == "movec":
            text, value = self.literal_pose()
            where.insert(0, (text, value, "pose", None))
            if where[1][1] is None:  # half a movec that is known would be a matter of taste
                kind = "movel"
                del where[0]
        arguments, stated = self.settings(kind)
        line = self.put(f"{kind}({self.comma.join([*(text for text, *_ in where), *arguments])})")
        if not self.is_run:
            self.not_run.append(line)
        elif where[-1][1] is None:
            self.unresolved.append(line)
        else:
            names = {"movej": "joint", "movel": "linear", "movep": "process", "movec": "arc", "servoj": "servo"}
            for number, (_, value, key, near) in enumerate(where, start=1):
                through = number < len(where)
                target = {"line": line, "kind": "through" if through else names[kind], key: value}
                target |= {"near": near} if near is not None else {}
                blend = () if through else ("blend_m",)
                kept = {k: v for k, v in stated.items() if k in ("speed", "acceleration", "time_s", *blend)}
                self.targets.append(target | {"tool": list(self.tool)} | kept)

    def settings(self, kind):
        """Arguments after the targets, positional, by name or none, and what they state."""
        rng = self.rng
        a, v, r = round(rng.uniform(0.2, 1.4), 3), round(rng.uniform(0.01, 1.0), 4), round(rng.uniform(0, 0.004), 4)
        if kind == "servoj":
            return rng.choice((["t=0.008", "gain=300"], ["0", "0", "0.008", "0.1", "300"])), {"time_s": 0.008}
        if rng.random() < 0.1:
            return [], {}
        stated = {"acceleration": a, "speed": v}
        if rng.random() < 0.4:
            arguments = [f"{a}", f"{v}"]
            if rng.random() < 0.6:
                arguments += [f"{r}"] if kind in ("movep", "movec") else ["0", f"{r}"]
                stated["blend_m"] = r
            return arguments, stated
        if kind in ("movej", "movel") and rng.random() < 0.2:
            return [f"t={v}", f"r={r}"], {"time_s": v, "blend_m": r}
        arguments = [f"a={a}", f"v = {v}", f"r={r}"]
        rng.shuffle(arguments)
        return arguments, stated | {"blend_m": r}

    def set_tool(self):
        if self.tool_functions and self.rng.random() < 0.3:
            name, tool = self.rng.choice(self.tool_functions)
            self.put(f"{name}()")
        else:
            tool = self.new_tool()
            self.put(f"set_tcp({self.tool_text(tool)})")
        self.tool = tool

    def new_tool(self):
        return [0.0, 0.0, round(self.rng.uniform(0.02, 0.15), 4), 0.0, 0.0, round(self.rng.uniform(-1, 1), 3)]

    def tool_text(self, tool):
        return f"p[{self.comma.join(str(v) for v in tool)}]"
