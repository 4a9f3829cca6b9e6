#!/usr/bin/python3
"""Measures the five nodes on a recording: processor time of each, age of the IMU-rate odometry, lost scans.

Plays the recording through fdi_lio.launch, with a master of its own, in an environment where the package is known
(`source build/devel/setup.bash`). Processor seconds are those of the kernel's accounting, for each second of data,
without the player. The age of an odometry message is the time from its IMU reading to itself, both as received here.
"""
import argparse
import json
import os
import pathlib
import re
import socket
import subprocess
import sys
import tempfile
import time
import xmlrpc.client

import numpy as np

from fdi_lio_scripts import errors
from fdi_lio_scripts.errors import UserError

NODES = ("imu_preintegration", "scan_deskew", "feature_extraction", "degeneracy_estimation", "mapping_optimization")
MANAGER = "nodelets"
START_TIMEOUT_S = 60.0
POLL_S = 0.2
QUEUE = 10000


def parse_arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--config", required=True, help="parameter file")
    parser.add_argument("--bag", required=True, help="recording")
    parser.add_argument("--rate", type=float, default=1.0, help="speed of playing")
    parser.add_argument("--duration", type=float, default=0.0, help="seconds of the recording; 0: to its end")
    parser.add_argument("--set", default="", metavar="'KEY=VALUE ...'", help="overrides of parameters")
    parser.add_argument("--nodelet", action="store_true", help="all nodes in one process")
    parser.add_argument("--output", metavar="FILE", help="also write the figures as JSON")
    return parser.parse_args()


def free_port() -> int:
    """A port of 127.0.0.1 that nobody uses."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def processor_seconds(pid: int) -> float:
    """User and system time of a process that runs."""
    fields = pathlib.Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Listener:
    """When each IMU reading and its odometry came, by their stamps."""

    def __init__(self, imu_topic: str) -> None:
        # ROS reads the master's address when it is imported.
        import rospy
        from fdi_lio.msg import ScanInfo
        from nav_msgs.msg import Odometry
        from sensor_msgs.msg import Imu

        self.readings = {}
        self.odometry = {}
        self.scans = 0
        self.lost_scans = 0
        rospy.init_node("benchmark_nodes", disable_signals=True)
        self.subscribers = [
            rospy.Subscriber(imu_topic, Imu, self.on_reading, queue_size=QUEUE, tcp_nodelay=True),
            rospy.Subscriber("/fdi_lio/odometry/imu", Odometry, self.on_odometry, queue_size=QUEUE, tcp_nodelay=True),
            rospy.Subscriber("/fdi_lio/odometry/lidar", Odometry, self.on_scan, queue_size=QUEUE),
            rospy.Subscriber("/fdi_lio/scan/info", ScanInfo, self.on_info, queue_size=QUEUE),
        ]

    def on_reading(self, message) -> None:
        """A reading of the IMU."""
        self.readings[message.header.stamp.to_nsec()] = time.monotonic()

    def on_odometry(self, message) -> None:
        """Odometry at the rate of the IMU."""
        self.odometry[message.header.stamp.to_nsec()] = time.monotonic()

    def on_scan(self, _message) -> None:
        """A scan was mapped."""
        self.scans += 1

    def on_info(self, message) -> None:
        """What became of the clouds so far."""
        self.lost_scans = message.lost_scans

    def ages_ms(self) -> np.ndarray:
        """Of the odometry messages whose reading was seen."""
        return np.array([1e3 * (came - self.readings[stamp])
                         for stamp, came in sorted(self.odometry.items()) if stamp in self.readings])


class Processes:
    """The processor time of the nodes, as last seen."""

    def __init__(self, master: str, names) -> None:
        self.master = master
        self.seconds = {}
        self.pids = {name: self.pid_of(name) for name in names}

    def pid_of(self, name: str) -> int:
        """Asks the node itself."""
        deadline = time.monotonic() + START_TIMEOUT_S
        while True:
            try:
                with xmlrpc.client.ServerProxy(self.master) as master:
                    address = master.lookupNode("/benchmark_nodes", f"/fdi_lio/{name}")[2]
                with xmlrpc.client.ServerProxy(address) as node:
                    return node.getPid("/benchmark_nodes")[2]
            except (OSError, xmlrpc.client.Error):
                if time.monotonic() > deadline:
                    raise UserError(f"the node {name} did not start within {START_TIMEOUT_S:g} s") from None
                time.sleep(POLL_S)

    def look(self) -> None:
        """Notes what each has used so far."""
        for name, pid in self.pids.items():
            try:
                self.seconds[name] = processor_seconds(pid)
            except OSError:
                pass  # it has ended: what was seen last stays


def wait_for_master(uri: str, launch: subprocess.Popen, log: pathlib.Path) -> None:
    """Waits until the master answers."""
    deadline = time.monotonic() + START_TIMEOUT_S
    with xmlrpc.client.ServerProxy(uri) as master:
        while True:
            try:
                master.getPid("/benchmark_nodes")
                return
            except OSError:
                if launch.poll() is not None or time.monotonic() > deadline:
                    raise UserError("roslaunch did not start: " + log.read_text(encoding="utf-8")[-500:]) from None
                time.sleep(0.05)


def topic_of(config: str, overrides: str) -> str:
    """The topic of the IMU."""
    text = overrides + "\n" + pathlib.Path(config).read_text(encoding="utf-8")
    found = re.search(r"imu_topic\s*[:=]\s*\"?([^\s\"]+)", text)
    return found[1] if found else "/imu_raw"


def measure(arguments: argparse.Namespace, folder: pathlib.Path) -> dict:
    """Runs the nodes once and gives all figures."""
    port = free_port()
    uri = f"http://127.0.0.1:{port}"
    os.environ.update(ROS_MASTER_URI=uri, ROS_HOSTNAME="127.0.0.1", ROS_HOME=str(folder))
    command = ["roslaunch", "-p", str(port), "fdi_lio", "fdi_lio.launch", "exit_at_end:=true",
               f"config:={os.path.abspath(arguments.config)}", f"bag:={os.path.abspath(arguments.bag)}",
               f"rate:={arguments.rate}", f"duration:={arguments.duration}", f"set:={arguments.set}",
               f"nodelet:={str(arguments.nodelet).lower()}", f"output:={folder / 'run'}"]
    log = folder / "launch.log"
    with open(log, "w", encoding="utf-8") as out:
        launch = subprocess.Popen(command, stdout=out, stderr=subprocess.STDOUT)
    try:
        wait_for_master(uri, launch, log)
        listener = Listener(topic_of(arguments.config, arguments.set))
        processes = Processes(uri, (MANAGER,) if arguments.nodelet else NODES)
        while launch.poll() is None:
            processes.look()
            time.sleep(POLL_S)
    finally:
        if launch.poll() is None:
            launch.terminate()
            launch.wait()
    if not listener.readings:
        raise UserError("no reading of the IMU came: " + log.read_text(encoding="utf-8")[-500:])
    stamps = sorted(listener.readings)
    data_s = 1e-9 * (stamps[-1] - stamps[0])
    ages = listener.ages_ms()
    cpu = {name: seconds / data_s for name, seconds in processes.seconds.items()}
    return {
        "data_s": data_s,
        "cpu_s_per_s": {**cpu, "total": sum(cpu.values())},
        "imu_readings": len(stamps),
        "imu_odometry": len(listener.odometry),
        "mapped_scans": listener.scans,
        "lost_scans": listener.lost_scans,
        "age_ms": {"median": float(np.median(ages)), "p95": float(np.percentile(ages, 95)),
                   "p99": float(np.percentile(ages, 99)), "max": float(ages.max())},
    }


def main() -> int:
    """Prints the figures."""
    arguments = parse_arguments()
    for path in (arguments.config, arguments.bag):
        if not os.path.isfile(path):
            raise UserError(f"{path}: there is no such file")
    with tempfile.TemporaryDirectory() as folder:
        figures = measure(arguments, pathlib.Path(folder))
    text = json.dumps(figures, indent=2)
    print(text)
    if arguments.output:
        errors.write_text(arguments.output, text + "\n")
    return 0


if __name__ == "__main__":
    errors.run(main)
