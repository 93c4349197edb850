"""The simulated stand and its diagnosis; `ros2 launch flea_diag stand.launch.py -s` lists all.

    ros2 launch flea_diag stand.launch.py fault:=winding_short fault_onset_s:=5.0
    ros2 launch flea_diag stand.launch.py namespace:=stand_2 stand:=false record:=false

With stand:=false the nodes wait for the DAQ of a real stand.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition, UnlessCondition
from launch.substitutions import LaunchConfiguration, PythonExpression
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = (
    ("namespace", "", "namespace of the stand, for example of a second stand"),
    ("stand", "true", "start the simulated stand"),
    ("scenario", "nominal", "scenario of the simulated stand: name or YAML file"),
    ("fault", "", "fault to inject in addition to those of the scenario"),
    ("fault_onset_s", "8.0", "onset of that fault [s]"),
    ("duration_s", "0.0", "duration of the run; 0: that of the scenario [s]"),
    ("calibration", "", "calibration file; empty: that of the simulated stand"),
    ("composed", "true", "diagnosis in one process; false: one process per stage"),
    ("record", "true", "record a bag"),
    ("bag", "", "bag to write; empty: bags/runs/<UTC time>"),
    ("console", "true", "print the verdict in this terminal"),
)


def value(name, kind):
    return ParameterValue(LaunchConfiguration(name), value_type=kind)


def node(executable, condition, parameters=()):
    return Node(
        package="flea_diag",
        executable=executable,
        namespace=LaunchConfiguration("namespace"),
        parameters=list(parameters),
        condition=condition,
        output="screen",
    )


def diagnosis():
    """The nodes whose readiness the stand waits for."""
    composed = LaunchConfiguration("composed")
    separate = "'observer,isolator,extractor'"
    return PythonExpression(
        ["'diagnoser' if '", composed, "'.lower() in ('true', '1') else ", separate]
    )


def generate_launch_description():
    composed = LaunchConfiguration("composed")
    calibration = {"calibration": value("calibration", str)}
    daq = {
        "scenario": value("scenario", str),
        "fault": value("fault", str),
        "fault_onset_s": value("fault_onset_s", float),
        "duration_s": value("duration_s", float),
        "wait_for": ParameterValue(diagnosis(), value_type=str),
    }
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, default_value=default, description=text)
                for name, default, text in ARGUMENTS
            ),
            node("diagnoser", IfCondition(composed), [calibration]),
            *(
                node(stage, UnlessCondition(composed), [calibration])
                for stage in ("observer", "isolator", "extractor")
            ),
            node(
                "recorder",
                IfCondition(LaunchConfiguration("record")),
                [{"directory": value("bag", str), **calibration}],
            ),
            node("console", IfCondition(LaunchConfiguration("console"))),
            node("daq", IfCondition(LaunchConfiguration("stand")), [daq]),
        ]
    )
