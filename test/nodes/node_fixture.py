"""Launches the real nodes, each time with a master of its own, on a short simulated drive."""
import filecmp
import os
import pathlib
import re
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
import xmlrpc.client

import numpy as np

BIN = pathlib.Path(sys.argv[1]).resolve()
SOURCE = pathlib.Path(sys.argv[2]).resolve()
DURATION_S = 15
MOUNTING = [0.0011, -0.0007, 0.0004, 0.99999907]  # rotation of T_imu_lidar, x y z w
# However busy the machine is, no node goes on without another's answer and no scan is left out.
PATIENT = "nodes.answer_timeout=5 nodes.scan_queue=300"


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Launch:
    """roslaunch with a master of its own."""

    def __init__(self, *arguments, home):
        self.port = free_port()
        self.environment = dict(os.environ, ROS_MASTER_URI=f"http://127.0.0.1:{self.port}", ROS_HOSTNAME="127.0.0.1",
                                ROS_HOME=str(home), PYTHONUNBUFFERED="1")
        self.log = home / f"launch_{self.port}.log"
        with open(self.log, "w", encoding="utf-8") as log:
            self.process = subprocess.Popen(
                ["roslaunch", "-p", str(self.port), str(SOURCE / "launch/fdi_lio.launch"), *map(str, arguments)],
                env=self.environment, stdout=log, stderr=subprocess.STDOUT)
        deadline = time.monotonic() + 30
        with xmlrpc.client.ServerProxy(self.environment["ROS_MASTER_URI"]) as master:
            while True:
                try:
                    master.getPid("/test_nodes")
                    return
                except OSError:
                    if time.monotonic() > deadline:
                        raise
                    time.sleep(0.05)

    def run(self, *command):
        return subprocess.run(command, env=self.environment, capture_output=True, text=True, check=False, timeout=60)

    def wait(self, timeout_s=180):
        self.process.wait(timeout_s)
        return self.text()

    def stop(self):
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGINT)
        self.process.wait(60)
        return self.text()

    def text(self):
        return self.log.read_text(encoding="utf-8")

    def pid_of(self, node):
        """Nothing while the node does not run."""
        info = self.run("rosnode", "info", f"/fdi_lio/{node}").stdout
        found = re.search(r"^Pid: (\d+)", info, re.MULTILINE)
        return int(found[1]) if found else None

    def wait_for_restart(self, node, pid_before, timeout_s=60):
        deadline = time.monotonic() + timeout_s
        while self.pid_of(node) in (None, pid_before):
            if time.monotonic() > deadline:
                raise AssertionError(f"{node} was not started again\n{self.text()}")

    def wait_for_topic(self, topic, message_count=1, timeout_s=60):
        done = subprocess.run(["timeout", str(timeout_s), "rostopic", "echo", "-n", str(message_count), topic],
                              env=self.environment, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise AssertionError(f"no message on {topic}: {done.stderr}\n{self.text()}")
        return done.stdout


def read_tum(path):
    return np.loadtxt(path, ndmin=2)


class Recording(unittest.TestCase):
    """A simulated recording, what offline_slam makes of it, and the nodes to play it to."""

    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.path = pathlib.Path(cls.folder.name)
        cls.bag = cls.path / "street.bag"
        subprocess.run(
            [BIN / "simulate_bag", "--scenario", SOURCE / "config/scenarios/street.yaml", "--seed", "8", "--output",
             cls.bag, "--duration", str(DURATION_S), "--set", "lidar.model=vlp16", "--set", "wheels.enabled=true"], check=True, capture_output=True)
        cls.config = cls.path / "street.config.yaml"
        # A mounting that is turned by a little: rotations that are rounded on their way show.
        text = cls.config.read_text(encoding="utf-8")
        turned = text.replace("rotation: [0, 0, 0, 1]", f"rotation: {MOUNTING}")
        assert turned != text
        cls.config.write_text(turned, encoding="utf-8")
        subprocess.run([BIN / "offline_slam", "--config", cls.config, "--bag", cls.bag, "--output",
                        cls.path / "offline"], check=True, capture_output=True)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def launch(self, *arguments):
        launch = Launch(f"config:={self.config}", *arguments, home=self.path)
        self.addCleanup(launch.stop)
        return launch

    def play(self, name, *arguments):
        return self.launch(f"bag:={self.bag}", f"output:={self.path / name}", "exit_at_end:=true", *arguments)

    def play_patiently(self, name, *arguments, set_also=""):
        return self.play(name, f"set:={PATIENT} {set_also}", *arguments)

    def expect_same_file(self, name, file, log):
        """The run left the file that offline_slam left; if not, says where they part and what the nodes said."""
        offline, nodes = self.path / "offline" / file, self.path / name / file
        if filecmp.cmp(offline, nodes, shallow=False):
            return
        lines = [path.read_bytes().splitlines() for path in (offline, nodes)]
        k = next((k for k, pair in enumerate(zip(*lines)) if pair[0] != pair[1]), min(map(len, lines)))
        parts = [str(part[k:k + 1])[:300] for part in lines]
        self.fail(f"{file} of {name} has {len(lines[1])} lines, offline {len(lines[0])}; from line {k + 1} on they "
                  f"differ:\n{parts[0]}\n{parts[1]}\n{log}")

    def expect_same_as_offline(self, name, log):
        for file in ("trajectory.tum", "odometry.tum", "degeneracy.csv", "covariance.csv", "directions.csv", "map.pcd"):
            self.expect_same_file(name, file, log)

    def expect_same_way(self, estimate, truth):
        """The first and the last pose are as far apart as they really are."""
        q = np.stack([np.interp(estimate[:, 0], truth[:, 0], truth[:, k]) for k in (1, 2, 3)], axis=1)
        moved = np.linalg.norm(estimate[-1, 1:4] - estimate[0, 1:4])
        self.assertLess(abs(moved - np.linalg.norm(q[-1] - q[0])), 1.0)


def run_tests():
    unittest.main(argv=sys.argv[:1] + sys.argv[3:], verbosity=2)
