"""What ``truepath plan`` prints: what the plan will bring, parameter by parameter, and what it costs."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich import box
from rich.table import Table

from truepath import console
from truepath.lie import Array
from truepath.planning.campaign import Plan
from truepath.planning.sight import Sight

UNITS = {"m": ("mm", 1e3), "rad": ("mrad", 1e3), "rad/(N m)": ("urad/(N m)", 1e6)}
WAVES = 4  # parameters of one term that are told one by one


def figures(plan: Plan) -> dict[str, Any]:
    """The numbers for machines."""
    design, random = plan.design, plan.design.random_sigma_m
    return {
        "rows": len(plan.poses),
        "measurements": int(plan.poses.measure.sum()),
        "poses": len(design.q_rad),
        "repeats": len(design.again),
        "candidates": plan.candidates,
        "tool_sigma_mm": {
            "mean": 1e3 * float(design.tool_sigma_m.mean()),
            "max": 1e3 * float(design.tool_sigma_m.max()),
        },
        "random_tool_sigma_mm": {"median": 1e3 * float(np.median(random)), "best": 1e3 * float(random.min())},
        "lower_by": 1.0 - float(design.tool_sigma_m.mean() / np.median(random)),
        "parameters": [
            {"name": name, "unit": unit, "sigma": float(sigma)} for name, unit, sigma, _ in _parameters(plan)
        ],
        "travel_rad": plan.travel_rad,
        "duration_s": plan.duration_s,
        "correlation_with_time": {
            "joints": np.abs(plan.mixing.joints).tolist(),
            "derivatives_max": float(np.abs(plan.mixing.columns).max(initial=0.0)),
        },
        "not_planned": list(plan.not_planned),
    }


def print_plan(plan: Plan, sight: Sight | None, cell: str | None) -> None:
    """For people."""
    found, out = figures(plan), console.out
    sides = ", each from both sides" if plan.poses.measure.sum() >= 2 * len(plan.design.q_rad) else ""
    via = len(plan.poses) - found["measurements"]
    out.print(
        f"{found['measurements']} measurements of {found['poses']} poses{sides}, {found['repeats']} visited again, "
        f"{via} rows to pass through; chosen from {found['candidates']} feasible ones",
        style="bold",
    )
    if cell is None:
        console.warn("no cell was looked at: nothing is said about collisions")
    if sight is None:
        out.print("no tracker was stated: the reflector is taken to be seen everywhere")
    table = Table(
        title="expected standard deviation of the tool position, mm", title_justify="left", box=box.SIMPLE_HEAD
    )
    for name, side in (("after", "left"), ("mean of the workspace", "right"), ("", "left")):
        table.add_column(name, justify=side)  # type: ignore[arg-type]
    sigma, random = found["tool_sigma_mm"], found["random_tool_sigma_mm"]
    table.add_row("these poses", f"{sigma['mean']:.4f}", f"{sigma['max']:.4f} at worst")
    by = f"median of {len(plan.design.random_sigma_m)} sets, the best {random['best']:.4f}"
    table.add_row("as many random feasible ones", f"{random['median']:.4f}", by)
    table.add_row("", f"{100 * found['lower_by']:.0f} % lower", "")
    out.print(table)
    out.print(_parameter_table(plan))
    turned = np.degrees(plan.travel_rad)
    out.print(f"travel {turned:.0f} degrees of the leading joint, about {plan.duration_s / 60:.0f} min with stops")
    joints = ", ".join(f"{abs(r):.2f}" for r in plan.mixing.joints)
    out.print(
        f"correlation of the order with the joints {joints}; with what the parameters do to the readings at most "
        f"{found['correlation_with_time']['derivatives_max']:.2f} (small: drift is told from pose)"
    )
    if plan.not_planned:
        names = ", ".join(name.replace("_", " ") for name in plan.not_planned)
        out.print(
            f"{names}: no choice of poses shows it; record time and temperature, the order and repeats do the rest"
        )


def _parameters(plan: Plan) -> list[tuple[str, str, float, float]]:
    """Name, unit, expected standard deviation, SI, and its share of the prior, of every parameter."""
    model = plan.model
    share: Array = np.sqrt(np.diag(plan.design.covariance))
    names = [(str(name), name.unit) for name in model.kinematic]
    for term in model.terms:
        place = "" if term.joint is None else f" of joint {term.joint}"
        names += [(f"{term.effect}{place}: {p.name}", p.unit) for p in term.parameters]
    return [(*name, float(s * w), float(s)) for name, s, w in zip(names, share, model.widths, strict=True)]


def _parameter_table(plan: Plan) -> Table:
    table = Table(title="expected parameters", title_justify="left", box=box.SIMPLE_HEAD)
    for name, side in (("parameter", "left"), ("sigma", "right"), ("unit", "left"), ("", "left")):
        table.add_column(name, justify=side)  # type: ignore[arg-type]
    many = {f"{t.effect} of joint {t.joint}" for t in plan.model.terms if len(t.parameters) > WAVES}
    told: dict[str, list[tuple[str, float, float]]] = {}
    for name, unit, sigma, share in _parameters(plan):
        group = name.partition(":")[0]
        told.setdefault(group if group in many else name, []).append((unit, sigma, share))
    for name, entries in told.items():
        unit, factor = UNITS.get(entries[0][0], (entries[0][0], 1.0))
        sigmas, unsure = [factor * s for _, s, _ in entries], max(share for _, _, share in entries) > np.sqrt(0.5)
        value = f"{sigmas[0]:.4g}" if len(entries) == 1 else f"{min(sigmas):.3g} to {max(sigmas):.3g}"
        table.add_row(name, value, unit, "hardly seen by these poses" if unsure else "")
    return table
