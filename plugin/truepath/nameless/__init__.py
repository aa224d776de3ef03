"""Forms that a cause without a name can take. They compete with the named effects, and nobody is named by them.

Where a pattern in what is left goes with something that no named effect knows (one joint's error with another
joint's angle, the bending of links sideways, the beam of the tracker, oscillation in time ...), one of these
explains it better than any named effect does, and keeps a wrong name from being given to it.
"""

from __future__ import annotations

from truepath.nameless import in_course, in_robot, in_tracker
from truepath.nameless.form import Nameless
from truepath.nameless.in_course import in_time
from truepath.nameless.in_robot import waves_of_a_joint

NAMELESS: dict[str, Nameless] = {form.name: form for form in (*in_robot.FORMS, *in_tracker.FORMS, *in_course.FORMS)}

__all__ = ["NAMELESS", "Nameless", "in_time", "waves_of_a_joint"]
