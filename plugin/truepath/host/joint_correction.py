"""The correction as a Drake system."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from pydrake.autodiffutils import AutoDiffXd, ExtractGradient, ExtractValue, InitializeAutoDiff
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import LeafSystem_, ValueProducer
from pydrake.systems.scalar_conversion import TemplateSystem

from truepath.correct import MAX_CORRECTION_MM
from truepath.errors import InputError
from truepath.host.placed_robot import PlacedRobot
from truepath.host.steady_correction import SteadyCorrection
from truepath.lie import Array


@TemplateSystem.define("JointCorrection_", T_list=[float, AutoDiffXd])
def JointCorrection_(T: type) -> type:
    class Impl(LeafSystem_[T]):
        """Turns desired joints into those that bring the real tool where the desired ones mean it to be.

        With all that the calibration knows of the robot: axes, base, tool, every effect, networks.

        Ports: input ``desired``; outputs ``corrected``, of the same size, ``valid`` (1 where all of the correction was
        made, 0 where it was faded or stopped at a limit: see ``SteadyCorrection``, whose results are continuous) and
        ``inside`` (1 where the calibration's data reached). Direct feedthrough, no state: the same input gives the same
        output, whatever came before. Solved once for each input and kept in a cache entry.

        Scalars: ``float`` and ``AutoDiffXd`` (derivatives by central differences: of joints to about 1e-5, of
        velocities to about 1e-4 of the velocity), so that a diagram with it can be cloned and linearised.
        ``Expression`` is not possible, for the solver is no expression: Drake says so where a conversion is asked for.

        Args:
            source: a plugin, or a calibration alone (then for the arm's joints only). The calibration that it has now:
                a later one is for a new system.
            takes: ``joints``, or ``state``, joints and then velocities, of which those of the arm are corrected too, as
                the corrected joints move.
            of: ``arm``, in the order of its joints, or ``plant``, all positions (and velocities) of the plugin's plant,
                of which those of others pass through.
            max_correction_mm: a larger correction fades.

        Raises:
            InputError: no calibration, no plant, an unknown word, less than six joints.
        """

        def _construct(
            self,
            source: Any,
            *,
            takes: Literal["joints", "state"] = "joints",
            of: Literal["arm", "plant"] = "arm",
            max_correction_mm: float = MAX_CORRECTION_MM,
            converter: Any = None,
        ) -> None:
            LeafSystem_[T].__init__(self, converter=converter)
            self.robot = source if isinstance(source, PlacedRobot) else PlacedRobot.of(source)
            self.settings = {"takes": takes, "of": of, "max_correction_mm": max_correction_mm}
            if takes not in ("joints", "state") or of not in ("arm", "plant"):
                raise InputError("unknown kind of input", expected="joints or state, of arm or plant")
            self._correct = SteadyCorrection(self.robot.model, max_correction_mm)
            n, place = self.robot.model.robot.num_joints, self.robot.place
            if of == "arm":
                self._q, self._v, size = np.arange(n), n + np.arange(n), n if takes == "joints" else 2 * n
            elif place is None:
                raise InputError("a calibration alone knows no plant", expected="a plugin, or of='arm'")
            else:
                nq, nv = place.plant.num_positions(), place.plant.num_velocities()
                self._q, self._v = place.positions, nq + place.velocities
                size = nq if takes == "joints" else nq + nv
            port = self.DeclareVectorInputPort("desired", size)
            self._solution = self.DeclareCacheEntry(
                "correction",
                ValueProducer(allocate=lambda: AbstractValue.Make([]), calc=self._solve),
                {self.input_port_ticket(port.get_index())},
            )
            after = {self._solution.ticket()}
            self.DeclareVectorOutputPort("corrected", size, self._corrected, prerequisites_of_calc=after)
            self.DeclareVectorOutputPort("valid", 1, self._valid, prerequisites_of_calc=after)
            self.DeclareVectorOutputPort("inside", 1, self._inside)

        def _construct_copy(self, other: Any, converter: Any = None) -> None:
            Impl._construct(self, other.robot, **other.settings, converter=converter)

        def _solve(self, context: Any, value: Any) -> None:
            desired = self.get_input_port(0).Eval(context)
            out = np.array(desired)
            if T is float:
                q = out[self._q]
                found = self._correct(q)
                out[self._q] = found.q_rad
                if self.settings["takes"] == "state":
                    out[self._v] = self._correct.along(q, out[self._v])
            else:
                q = ExtractValue(desired[self._q]).ravel()
                found = self._correct(q)
                J, q_ad = self._correct.jacobian(q), desired[self._q]
                out[self._q] = _with_derivatives(found.q_rad, (J, q_ad))
                if self.settings["takes"] == "state":
                    v_ad = desired[self._v]
                    v = ExtractValue(v_ad).ravel()
                    H = self._correct.along_and_around(q, v)
                    out[self._v] = _with_derivatives(self._correct.along(q, v), (H, q_ad), (J, v_ad))
            value.set_value([out, found.valid])

        def _corrected(self, context: Any, output: Any) -> None:
            output.SetFromVector(self._solution.Eval(context)[0])

        def _valid(self, context: Any, output: Any) -> None:
            output.SetFromVector([float(self._solution.Eval(context)[1])])

        def _inside(self, context: Any, output: Any) -> None:
            q = self.get_input_port(0).Eval(context)[self._q]
            q = q if T is float else ExtractValue(q).ravel()
            output.SetFromVector([float(self.robot.region.contains(q[None])[0])])

    return Impl


JointCorrection = JointCorrection_[float]


def _with_derivatives(value: Array, *slopes_and_inputs: tuple[Array, Array]) -> Array:
    """``(n,)`` with the derivatives of the inputs ``(n,)`` that it depends on by slopes ``(n, n)``: the chain rule."""
    gradients = [(slope, ExtractGradient(given)) for slope, given in slopes_and_inputs]
    known = [slope @ gradient for slope, gradient in gradients if gradient.shape[1]]
    if not known:
        return InitializeAutoDiff(value).ravel()
    return InitializeAutoDiff(value, sum(known)).ravel()
