"""Replay a bag through the nodes: what the stand sent goes out again, the diagnosis is new.

    ros2 launch flea_diag replay.launch.py bag:=bags/jam
    ros2 launch flea_diag replay.launch.py bag:=bags/jam rate:=4.0 loop:=true

`flea replay BAG` gives the same verdict without ROS, faster than real time.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.conditions import IfCondition, UnlessCondition
from launch.substitutions import LaunchConfiguration, PythonExpression
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

# Only what a stand sends: recorded verdicts would contradict those that are found now.
SOURCES = ("sensors/channels", "sensors/slow", "sensors/vibration", "truth")

ARGUMENTS = (
    ("bag", None, "bag to replay"),
    ("namespace", "", "of the topics in the bag"),
    ("calibration", "", "calibration file, empty: the simulated stand's"),
    ("rate", "1.0", "speed: 1 is as it was recorded"),
    ("loop", "false", "start again at the end; the nodes then start afresh"),
    ("composed", "true", "the diagnosis in one process; false: one process a stage"),
    ("console", "true", "show the verdict here"),
)

REPLAY = {"source": "replay"}
"""A verdict that says so rings no alarm."""


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
    # --delay gives the nodes time to be found: volatile messages sent before that are lost.
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
