"""Robots with a hidden cause for the diagnosis to find: only a CSV is handed over, the truth stays sealed.

    case = draw_case("single:backlash", seed=3)
    Path("data.csv").write_text(case.csv)      # all that a diagnosis may see
    case.unseal()                              # what was hidden, once the verdict is in

Kinematics and gravity are Drake's, the causes have formulas of their own: nothing of truepath's model is used.
"""

from hidden_effects.case import CONFOUNDED, EFFECTS, HiddenCase, Truth, draw_case

__all__ = ["CONFOUNDED", "EFFECTS", "HiddenCase", "Truth", "draw_case"]
