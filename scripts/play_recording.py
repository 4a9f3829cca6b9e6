#!/usr/bin/python3
"""Plays a recording to the nodes and ends when its last scan has been mapped.

Waits until all nodes run, starts `rosbag play --clock --pause`, lets it go when everybody who listens is connected, so
that nothing of the beginning is lost, and after its end waits until mapping has been silent for a while. Where the
recording lacks the lidar's topic and has exactly one other of a fitting type, that one is played in its place. Made for
fdi_lio.launch.
"""
import argparse
import os
import signal
import subprocess
import sys
import time
import xmlrpc.client

import rosbag
import rosgraph
import rospy
from fdi_lio.msg import EstimatorState
from std_srvs.srv import SetBool

TOPICS = ("scan/deskewed", "scan/info", "imu/preintegrated", "features/all", "degeneracy", "mapping/status",
          "mapping/state")
LIDAR_TYPES = ("sensor_msgs/PointCloud2", "velodyne_msgs/VelodyneScan")
NODES_TIMEOUT_S = 60.0
CONNECT_TIMEOUT_S = 10.0
# Messages kept for a node that does not read for a while: seconds of the fastest IMU.
QUEUE = 2000
# How long mapping may take for one scan; beside that, the last scan waits for readings that will never come.
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


def wait_for_connections(player):
    """Waits until everybody who listens to a topic of the player is connected to it."""
    master = rosgraph.Master(rospy.get_name())
    deadline = time.monotonic() + CONNECT_TIMEOUT_S
    with xmlrpc.client.ServerProxy(master.lookupNode(player)) as node:
        while not rospy.is_shutdown():
            publishers, subscribers, _ = master.getSystemState()
            played = {topic for topic, nodes in publishers if player in nodes}
            wanted = {(topic, name) for topic, names in subscribers if topic in played for name in names}
            connections = node.getBusInfo(rospy.get_name())[2]
            missing = wanted - {(topic, name) for _, name, _, _, topic, *_ in connections}
            if not missing:
                return
            if time.monotonic() > deadline:
                rospy.logwarn("not connected to the recording after %.0f s, playing without: %s", CONNECT_TIMEOUT_S,
                              ", ".join("%s of %s" % pair for pair in sorted(missing)))
                return
            time.sleep(0.02)


def let_go(player, process):
    """Ends the pause in which `rosbag play` began."""
    service = player + "/pause_playback"
    while process.poll() is None and not rospy.is_shutdown():
        try:
            rospy.wait_for_service(service, 0.1)
            pause = rospy.ServiceProxy(service, SetBool)
            pause(True)  # is answered when the player has opened the recording and announced its topics
            wait_for_connections(player)
            pause(False)
            return
        except (rospy.ROSException, rospy.ServiceException, rosgraph.MasterException, OSError):
            time.sleep(0.02)  # not there yet, or it has just ended: then the loop does, too


def play(arguments, remapping):
    player_name = rospy.get_name().strip("/").replace("/", "_") + "_player"
    command = ["rosbag", "play", "--clock", "--quiet", "--pause", "--queue", str(QUEUE), "--rate", str(arguments.rate)]
    if arguments.start > 0:
        command += ["--start", str(arguments.start)]
    if arguments.duration > 0:
        command += ["--duration", str(arguments.duration)]
    # rosbag announces "clock" relative to its namespace, and everybody listens to /clock.
    environment = {name: value for name, value in os.environ.items() if name != "ROS_NAMESPACE"}
    player = subprocess.Popen(command + arguments.bags + remapping + ["__name:=" + player_name], env=environment)
    let_go("/" + player_name, player)
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
    silence_s = SILENCE_S + rospy.get_param("scan_deskew/answer_timeout")
    while time.monotonic() - watch.last < silence_s and not rospy.is_shutdown():
        time.sleep(0.1)
    rospy.loginfo("the recording has ended; mapping answered %d scans", watch.count)
    if watch.count == 0:
        rospy.logerr("mapping answered no scan: does the recording have the topics of the parameter file?")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
