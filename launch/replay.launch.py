"""Replay the topics of the stand from a bag; the diagnosis is recomputed.

    ros2 launch flea_diag replay.launch.py bag:=bags/jam
    ros2 launch flea_diag replay.launch.py bag:=bags/jam rate:=4.0 loop:=true

`flea replay BAG` gives the same verdict without ROS and faster than real time.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.conditions import IfCondition, UnlessCondition
from launch.substitutions import LaunchConfiguration, PythonExpression
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

# Topics of the stand only: recorded verdicts would interfere with the new ones.
SOURCES = ("sensors/channels", "sensors/slow", "sensors/vibration", "truth")

ARGUMENTS = (
    ("bag", None, "bag to replay"),
    ("namespace", "", "namespace of the topics in the bag"),
    ("calibration", "", "calibration file; empty: that of the simulated stand"),
    ("rate", "1.0", "playback rate; 1: as recorded"),
    ("loop", "false", "loop the bag; the diagnosis restarts with each pass"),
    ("composed", "true", "diagnosis in one process; false: one process per stage"),
    ("console", "true", "print the verdict in this terminal"),
)

REPLAY = {"source": "replay"}
"""Marks the verdicts as those of a replay, which raise no alarm."""


def node(executable, condition, parameters=()):
    return Node(
        package="flea_diag",
        executable=executable,
        namespace=LaunchConfiguration("namespace"),
        parameters=[{"use_sim_time": True}, *parameters],
        condition=condition,
        output="screen",
    )


def play(condition, *more):
    topics = [
        PythonExpression(
            ["('/' + '", LaunchConfiguration("namespace"), f"').rstrip('/') + '/{topic}'"]
        )
        for topic in SOURCES
    ]
    rate = LaunchConfiguration("rate")
    # --delay leaves time for discovery: volatile messages published before it are lost.
    command = ["ros2", "bag", "play", LaunchConfiguration("bag"), "--clock", "100", "--delay", "3"]
    return ExecuteProcess(
        cmd=[*command, "--rate", rate, *more, "--topics", *topics],
        condition=condition,
        output="screen",
    )


def generate_launch_description():
    composed, loop = LaunchConfiguration("composed"), LaunchConfiguration("loop")
    calibration = {
        "calibration": ParameterValue(LaunchConfiguration("calibration"), value_type=str)
    }
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, default, text in ARGUMENTS
            ),
            node("diagnoser", IfCondition(composed), [calibration, REPLAY]),
            node("observer", UnlessCondition(composed), [calibration]),
            node("isolator", UnlessCondition(composed), [calibration, REPLAY]),
            node("extractor", UnlessCondition(composed), [calibration]),
            node("console", IfCondition(LaunchConfiguration("console"))),
            play(UnlessCondition(loop)),
            play(IfCondition(loop), "--loop"),
        ]
    )
