"""Robots and data that the tests share."""

import os
import signal
import sys
from pathlib import Path

import pytest
from chromium import DRAWING, headless
from command import run
from hidden import Hidden, none
from hypothesis import settings
from hypothesis import strategies as st
from threadpoolctl import threadpool_limits
from truepath.calibrate import fit_kinematics
from truepath.plants import load_robot
from truepath.virtual.real_robot import RealRobot

ROOT = Path(__file__).parents[1]

# The same examples in every run: what a property test finds today it finds in everybody's run.
settings.register_profile("truepath", derandomize=True, deadline=None, database=None)
settings.load_profile("truepath")

# A shell that starts the tests in the background lets them ignore Ctrl-C, and nohup a terminal that is closed; what
# they start would inherit that.
for number, usual in ((signal.SIGINT, signal.default_int_handler), (signal.SIGHUP, signal.SIG_DFL)):
    if signal.getsignal(number) is signal.SIG_IGN:
        signal.signal(number, usual)

# A machine may be told to keep no compiled files. Then every command that a test starts compiles the package anew.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# A file goes to one worker as a whole: those that take longest first, so that nobody waits for one at the end.
LONGEST_FIRST = (
    "test_readme.py",
    "test_closed_loop_workflow.py",
    "test_docs.py",
    "test_hidden_effects.py",
    "test_preview_page.py",
    "test_batch_cluster.py",
    "test_cell_workflow.py",
    "test_demo.py",
    "test_preview_program.py",
    "test_batch_ci.py",
)


def pytest_collection_modifyitems(items):
    places = {name: number for number, name in enumerate(LONGEST_FIRST)}
    items.sort(key=lambda item: places.get(item.path.name, len(places)))


# Seven joints about axes in mixed directions (some not of unit length), turned joint frames, fixed joints
# between moving ones, a load beside the chain, and a base that is neither upright nor at the origin.
SEVEN_JOINT_URDF = """<?xml version="1.0"?>
<robot name="seven" xmlns:drake="http://drake.mit.edu">
  <link name="world"/>
  <link name="foot">
    <inertial><origin xyz="0.01 0 0.05"/><mass value="4"/>
      <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial>
  </link>
  <joint name="mounting" type="fixed">
    <parent link="world"/><child link="foot"/><origin xyz="0.3 -0.2 0.7" rpy="0.5 -0.3 1.1"/>
  </joint>
{links}
  <link name="counterweight">
    <inertial><origin xyz="0 0.02 0.01" rpy="0.1 0 0"/><mass value="0.9"/>
      <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial>
  </link>
  <joint name="counterweight_mount" type="fixed">
    <parent link="link3"/><child link="counterweight"/><origin xyz="-0.15 0.04 0.02" rpy="0.3 0 0.2"/>
  </joint>
  <link name="flange"/>
  <joint name="flange_mount" type="fixed">
    <parent link="link7"/><child link="flange"/><origin xyz="0.02 -0.01 0.09" rpy="-0.4 0.6 0.2"/>
  </joint>
</robot>
"""
SEVEN_JOINT_LINKS = (  # axis, origin of the joint on what carries it, centre of mass, mass, limits
    ("0 0 1", "0.02 0.01 0.18", "0.05 -0.04 0.3", "0.01 0.02 0.08", 3.1, -2.9, 2.9),
    ("0 1 0", "0.00 0.05 0.16", "-0.3 0.1 0.2", "0.03 -0.02 0.10", 2.7, -2.0, 2.1),
    ("1 1 0", "0.03 0.00 0.21", "0.4 0.3 -0.6", "-0.02 0.03 0.09", 2.2, -2.8, 2.7),
    ("0 -1 0", "0.04 -0.03 0.19", "0.0 0.7 0.1", "0.01 0.01 0.07", 1.8, -2.2, 2.3),
    ("-0.3 0.5 -0.8", "0.00 0.02 0.20", "0.2 -0.5 0.9", "0.02 -0.03 0.06", 1.5, -2.6, 2.8),
    ("1 0 0", "-0.02 0.04 0.17", "-0.8 0.2 0.3", "0.00 0.02 0.05", 1.1, -2.1, 2.0),
    ("0 2 1", "0.05 0.00 0.11", "0.6 -0.4 0.5", "0.01 0.00 0.04", 0.6, -3.0, 3.0),
)
BRACKETS = {3: "0.01 0.02 0.03", 6: "-0.02 0.01 0.04"}  # a bracket is welded to this link and carries the next joint


def _seven_joint_links() -> str:
    parts, carrier = [], "foot"
    for number, (axis, xyz, rpy, centre, mass, lower, upper) in enumerate(SEVEN_JOINT_LINKS, start=1):
        parts.append(f"""  <link name="link{number}">
    <inertial><origin xyz="{centre}" rpy="0.2 0.1 0"/><mass value="{mass}"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
  </link>
  <joint name="joint{number}" type="revolute">
    <parent link="{carrier}"/><child link="link{number}"/><origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>
    <limit lower="{lower}" upper="{upper}" velocity="{1 + number / 10}" effort="100"
           drake:acceleration="{5 + number / 10}"/>
  </joint>""")
        carrier = f"link{number}"
        if number in BRACKETS:
            carrier = f"bracket{number}"
            parts.append(f"""  <link name="{carrier}">
    <inertial><origin xyz="0.01 0 0.02"/><mass value="0.4"/>
      <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial>
  </link>
  <joint name="{carrier}_mount" type="fixed">
    <parent link="link{number}"/><child link="{carrier}"/>
    <origin xyz="{BRACKETS[number]}" rpy="0.3 -0.2 0.4"/>
  </joint>""")
    return "\n".join(parts)


@pytest.fixture(scope="session")
def ur5():
    """The nominal UR5."""
    return load_robot("ur5")


@pytest.fixture(scope="session")
def ur10():
    """The nominal UR10."""
    return load_robot("ur10")


@pytest.fixture(scope="session")
def seven_joint_urdf() -> str:
    """Text of a URDF of a seven-joint arm; flange ``flange``, base link ``foot`` welded to the world askew."""
    return SEVEN_JOINT_URDF.format(links=_seven_joint_links())


@pytest.fixture(scope="session")
def seven_joint_arm(tmp_path_factory, seven_joint_urdf) -> Path:
    """That URDF as a file."""
    path = tmp_path_factory.mktemp("seven") / "seven.urdf"
    path.write_text(seven_joint_urdf)
    return path


@pytest.fixture(scope="session")
def seven(seven_joint_arm):
    """The nominal robot read from it."""
    return load_robot(seven_joint_arm)


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """Folder of the published data sets: $TRUEPATH_DATA, or ``shared/data`` beside the repository.

    Without it the test is skipped; on CI, where it must be there, the test fails.
    """
    folder = Path(os.environ.get("TRUEPATH_DATA") or ROOT.parent / "shared" / "data")
    if folder.is_dir():
        return folder
    reason = f"no published data sets in {folder}: set TRUEPATH_DATA to their folder"
    if os.environ.get("CI", "").lower() == "true":
        pytest.fail(reason, pytrace=False)
    pytest.skip(reason)


@pytest.fixture(scope="session", autouse=True)
def one_thread():
    """Threads on matrices of this size cost more than they bring."""
    with threadpool_limits(limits=1):
        yield


@pytest.fixture(scope="module")  # a second one, of the tests of another page, cannot be open at the same time
def browser():
    """That can draw."""
    with headless(DRAWING) as chromium:
        yield chromium


@pytest.fixture(scope="session")
def real_ur5():
    """A UR5 with hidden errors of its geometry."""
    return RealRobot("ur5", 21)


@pytest.fixture(scope="session")
def clean(real_ur5):
    """200 poses of it, nothing but geometry being wrong, with everything recorded that there is to record."""
    return Hidden(real_ur5, none).measured(200, 5, recorded=True)


@pytest.fixture(scope="session")
def clean_kinematic(real_ur5, clean):
    """The kinematics fitted to these."""
    return fit_kinematics(real_ur5.robot, clean)


@pytest.fixture
def truepath(monkeypatch, capsys):
    """Function: runs the command in this process, as the entry point does."""

    def truepath(*arguments):
        return run(monkeypatch, capsys, *arguments)

    return truepath


INSERTIONS = [b",", b";", b"\n", b"\r", b'"', b"\x00", b"\xff", b"-", b"e", b".", b"_", b"nan", b"9" * 400, b"{", b"]"]


@st.composite
def _spoilt(draw, good: bytes) -> bytes:
    content = bytearray(good)
    for _ in range(draw(st.integers(1, 3))):
        at = draw(st.integers(0, max(len(content) - 1, 0)))
        kind = draw(st.sampled_from(["cut", "remove", "overwrite", "insert", "repeat"]))
        if kind == "cut":
            del content[at:]
        elif kind == "remove":
            del content[at : at + draw(st.integers(1, 40))]
        elif kind == "overwrite":
            content[at : at + 1] = bytes([draw(st.integers(0, 255))])
        elif kind == "insert":
            content[at:at] = draw(st.one_of(st.sampled_from(INSERTIONS), st.binary(min_size=1, max_size=4)))
        else:
            content[at:at] = content[at : at + draw(st.integers(1, 200))]
    return bytes(content)


@pytest.fixture(scope="session")
def spoilt():
    """Hypothesis strategy: the bytes of a good file after a few cuts, overwritten bytes, insertions and repeats."""
    return _spoilt
