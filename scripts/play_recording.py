#!/usr/bin/python3
"""Plays a recording to the nodes and ends when its last scan has been mapped.

Waits until all nodes listen, so that nothing of the beginning is lost, starts `rosbag play --clock`, and after its end
waits until mapping has been silent for a while. Where the recording lacks the lidar's topic and has exactly one other of
a fitting type, that one is played in its place. Made for fdi_lio.launch.
"""
import argparse
import os
import signal
import subprocess
import sys
import time

import rosbag
import rosgraph
import rospy
from fdi_lio.msg import EstimatorState

TOPICS = ("scan/deskewed", "scan/info", "imu/preintegrated", "features/all", "degeneracy", "mapping/status",
          "mapping/state")
LIDAR_TYPES = ("sensor_msgs/PointCloud2", "velodyne_msgs/VelodyneScan")
NODES_TIMEOUT_S = 60.0
# Between advertising the recording's topics and its first message.
CONNECT_S = 1.0
SILENCE_S = 2.0


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bags", nargs="+", metavar="BAG")
    parser.add_argument("--rate", type=float, default=1.0, help="speed of playing")
    parser.add_argument("--start", type=float, default=0.0, help="seconds to skip")
    parser.add_argument("--duration", type=float, default=0.0, help="seconds to play; 0: to the end")
    return parser.parse_args(rospy.myargv()[1:])


def check(arguments):
    """What cannot be played ends the script with a message."""
    if arguments.rate <= 0:
        sys.exit("play_recording: --rate is %g, must be above 0" % arguments.rate)
    for path in arguments.bags:
        if not os.path.isfile(path):
            sys.exit("play_recording: there is no recording %s" % path)


def wait_for_nodes():
    """Waits until every topic between the nodes has somebody who sends and somebody who listens."""
    master = rosgraph.Master(rospy.get_name())
    deadline = time.monotonic() + NODES_TIMEOUT_S
    needed = {rospy.resolve_name(topic) for topic in TOPICS}
    while not rospy.is_shutdown():
        publishers, subscribers, _ = master.getSystemState()
        missing = needed - {topic for topic, _ in publishers} & {topic for topic, _ in subscribers}
        if not missing:
            return
        if time.monotonic() > deadline:
            sys.exit("play_recording: nobody sends or listens on %s after %.0f s: did all nodes start?" %
                     (", ".join(sorted(missing)), NODES_TIMEOUT_S))
        time.sleep(0.1)


class MappingWatch:
    """When mapping last answered, in steady time."""

    def __init__(self):
        self.last = time.monotonic()
        self.count = 0
        self.subscriber = rospy.Subscriber("mapping/state", EstimatorState, self.on_state, queue_size=50)

    def on_state(self, _message):
        self.last = time.monotonic()
        self.count += 1


def lidar_remapping(bags, wanted):
    """Arguments for `rosbag play` that bring the clouds or packets of the recording to the topic `wanted`."""
    fitting = set()
    for path in bags:
        try:
            with rosbag.Bag(path) as bag:
                topics = bag.get_type_and_topic_info().topics
        except rosbag.ROSBagException as error:
            sys.exit("play_recording: cannot read %s: %s" % (path, error))
        fitting |= {"/" + topic.lstrip("/") for topic, info in topics.items() if info.msg_type in LIDAR_TYPES}
    if wanted in fitting:
        return []
    if len(fitting) != 1:
        sys.exit("play_recording: the recording has no lidar messages on %s; topics of the right type: %s. Choose one "
                 "with points_topic:=/TOPIC" % (wanted, ", ".join(sorted(fitting)) or "none"))
    found = fitting.pop()
    rospy.logwarn("the recording has no lidar messages on %s: taking %s, the only topic of a fitting type", wanted, found)
    return ["%s:=%s" % (found, wanted)]


def play(arguments, remapping):
    command = ["rosbag", "play", "--clock", "--quiet", "--delay", str(CONNECT_S), "--rate", str(arguments.rate)]
    if arguments.start > 0:
        command += ["--start", str(arguments.start)]
    if arguments.duration > 0:
        command += ["--duration", str(arguments.duration)]
    # rosbag announces "clock" relative to its namespace, and everybody listens to /clock.
    environment = {name: value for name, value in os.environ.items() if name != "ROS_NAMESPACE"}
    player = subprocess.Popen(command + arguments.bags + remapping, env=environment)
    while player.poll() is None and not rospy.is_shutdown():
        time.sleep(0.1)
    if player.poll() is None:
        player.send_signal(signal.SIGINT)
        player.wait()
    return player.returncode


def main():
    arguments = parse_arguments()
    check(arguments)
    rospy.init_node("play_recording", disable_signals=False)
    wait_for_nodes()
    watch = MappingWatch()
    code = play(arguments, lidar_remapping(arguments.bags, rospy.get_param("scan_deskew/points_topic")))
    if code != 0:
        return code
    watch.last = time.monotonic()
    while time.monotonic() - watch.last < SILENCE_S and not rospy.is_shutdown():
        time.sleep(0.1)
    rospy.loginfo("the recording has ended; mapping answered %d scans", watch.count)
    if watch.count == 0:
        rospy.logerr("mapping answered no scan: does the recording have the topics of the parameter file?")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
