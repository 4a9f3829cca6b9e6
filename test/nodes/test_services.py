#!/usr/bin/python3
"""The services of mapping_optimization, called while a recording plays and when things go wrong.

usage: test_services.py BIN_DIR SOURCE_DIR [TEST...]
"""
import os
import re
import shutil
import signal
import subprocess
import time
import xmlrpc.client

import numpy as np
import yaml
from node_fixture import BIN, PATIENT, SOURCE, Recording, read_tum, run_tests


class Services(Recording):
    def setUp(self):
        self.saves = self.path / self.id().rsplit(".", maxsplit=1)[-1]
        self.saves.mkdir()

    def call(self, launch, name, request=None):
        """The answer of a service as a dictionary."""
        arguments = [yaml.safe_dump(request, default_flow_style=True).strip()] if request else []
        done = launch.run("rosservice", "call", "--wait", f"/fdi_lio/{name}", *arguments)
        self.assertEqual(done.returncode, 0, done.stderr + launch.text())
        return yaml.safe_load(done.stdout)

    def save(self, launch, path, **request):
        return self.call(launch, "save_map", {"path": str(path), **request})

    def play_on(self, *arguments):
        """A launch whose nodes stay when the recording has ended. Nothing is left out."""
        return self.launch(f"bag:={self.bag}", f"set:={PATIENT}", *arguments)

    def wait_for_end(self, launch):
        self.wait_for(lambda: "recording has ended" in launch.text(), launch)

    def play_to_the_end(self, *arguments):
        launch = self.play_on(*arguments)
        self.wait_for_end(launch)
        return launch

    def wait_for(self, condition, launch, timeout_s=120):
        deadline = time.monotonic() + timeout_s
        while not condition():
            self.assertLess(time.monotonic(), deadline, launch.text())
            time.sleep(0.05)

    def expect_whole(self, session):
        """The session can be read and every file is as it was saved."""
        done = subprocess.run([BIN / "optimise_session", "--config", self.config, "--session", session, "--output",
                               self.saves / f"check_{session.name}", "--set", "loop.enabled=false"],
                              capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)

    def expect_failure(self, answer, *texts):
        self.assertFalse(answer["success"], answer)
        self.assertEqual(answer["path"], "")
        for text in texts:
            self.assertIn(text, answer["message"])

    def test_saving_while_driving_changes_nothing_and_nothing_is_overwritten(self):
        launch = self.play_on(f"output:={self.path / 'saving'}")
        launch.wait_for_topic("/fdi_lio/odometry/lidar/header", 60)
        target = self.saves / "below" / "map"
        first = self.save(launch, target, format="ply", layers=True, resolution=0.5)
        self.assertTrue(first["success"], first)
        self.assertEqual(first["path"], str(target))
        files = {str(file.relative_to(target)): file.stat().st_mtime_ns for file in target.rglob("*")}
        self.wait_for_end(launch)
        second = self.save(launch, str(target) + "/")
        self.assertTrue(second["success"], second)
        self.assertRegex(second["path"], re.escape(str(target)) + r"_\d{8}_\d{6}$")
        self.assertGreater(second["keyframes"], first["keyframes"])
        shown = launch.wait_for_topic("/fdi_lio/keyframes/poses")
        self.assertEqual(shown.count("position:"), second["keyframes"])
        self.assertGreater(int(launch.wait_for_topic("/fdi_lio/map/global/width").split()[0]), 1000)
        tum = self.call(launch, "save_trajectory", {"path": str(self.saves / "way.tum")})
        kitti = self.call(launch, "save_trajectory", {"path": str(self.saves / "way.tum"), "format": "kitti"})
        self.assertTrue(tum["success"] and kitti["success"], (tum, kitti))
        self.assertRegex(kitti["path"], r"way_\d{8}_\d{6}\.tum$")
        launch.stop()
        # The last scan waits for IMU readings after it, which a recording that ended has not.
        for file in ("odometry.tum", "degeneracy.csv", "covariance.csv"):
            alone = (self.path / "offline" / file).read_text(encoding="utf-8").splitlines()
            saving = (self.path / "saving" / file).read_text(encoding="utf-8").splitlines()
            self.assertGreaterEqual(len(saving), len(alone) - 1)
            self.assertEqual(saving, alone[:len(saving)], file)
        self.assertEqual(files, {str(file.relative_to(target)): file.stat().st_mtime_ns for file in target.rglob("*")})
        for name in ("map.ply", "map_planes.ply", "map_edges.ply", "trajectory.tum", "trajectory_kitti.txt", "graph.g2o",
                     "places.bin", "keyframes/000000.pcd"):
            self.assertIn(name, files)
        self.assertEqual(len(read_tum(target / "trajectory.tum")), first["keyframes"])
        for session in sorted(target.parent.iterdir()):
            self.expect_whole(session)
        poses = read_tum(self.saves / "way.tum")
        self.assertEqual(len(poses), tum["poses"])
        np.testing.assert_array_equal(poses, read_tum(self.path / "saving/trajectory.tum")[:len(poses)])
        self.assertEqual(np.loadtxt(kitti["path"]).shape, (kitti["poses"], 12))

    def test_what_cannot_be_saved_is_said(self):
        idle = self.launch()
        self.expect_failure(self.save(idle, self.saves / "early"), "no map yet")
        self.assertIn("none has come yet", self.call(idle, "reset")["message"])
        idle.stop()
        launch = self.play_to_the_end()
        self.expect_failure(self.save(launch, "relative/map"), "not absolute")
        self.expect_failure(self.save(launch, ""), "not absolute")
        self.expect_failure(self.save(launch, self.saves / "map", format="las"), "pcd or ply")
        self.expect_failure(self.save(launch, self.saves / "map", resolution=-1.0), "resolution")
        self.expect_failure(self.save(launch, "/proc/map"), "/proc/map")
        (self.saves / "file").write_text("in the way", encoding="utf-8")
        self.expect_failure(self.save(launch, self.saves / "file/map"), "file/map")
        self.expect_failure(self.call(launch, "save_trajectory", {"path": "/proc/way.tum"}), "/proc/way")
        self.expect_failure(self.call(launch, "save_trajectory",
                                      {"path": str(self.saves / "way"), "format": "csv"}), "tum or kitti")
        self.assertEqual([file.name for file in self.saves.iterdir()], ["file"])

    def test_full_disk_leaves_the_earlier_save_whole(self):
        if os.geteuid() != 0:
            self.skipTest("needs root, for a small file system")
        launch = self.play_to_the_end()
        first = self.save(launch, self.saves / "first")
        self.assertTrue(first["success"], first)
        size = sum(file.stat().st_size for file in (self.saves / "first").rglob("*"))
        disk = self.saves / "disk"
        disk.mkdir()
        if subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={3 * size // 2}", "tmpfs", disk], check=False,
                          capture_output=True).returncode != 0:
            self.skipTest("this machine lets nobody mount")
        self.addCleanup(subprocess.run, ["umount", disk], check=True)
        first = self.save(launch, disk / "map")
        self.assertTrue(first["success"], first)
        self.expect_failure(self.save(launch, disk / "map"), str(disk / "map_2"), "space")
        self.assertEqual([file.name for file in disk.iterdir()], ["map"])
        self.expect_whole(disk / "map")

    def process_of(self, launch, node):
        with xmlrpc.client.ServerProxy(launch.environment["ROS_MASTER_URI"]) as master:
            _, _, uri = master.lookupNode("/test_services", f"/fdi_lio/{node}")
        with xmlrpc.client.ServerProxy(uri) as slave:
            return slave.getPid("/test_services")[2]

    def test_a_node_that_is_killed_in_the_middle_leaves_the_earlier_save_whole(self):
        launch = self.play_to_the_end()
        self.assertTrue(self.save(launch, self.saves / "map")["success"])
        process = self.process_of(launch, "mapping_optimization")
        call = subprocess.Popen(["rosservice", "call", "/fdi_lio/save_map", f"{{path: {self.saves / 'map'}}}"],
                                env=launch.environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        while not list(self.saves.glob("*.part*/keyframes/*")):
            self.assertIsNone(call.poll(), launch.text())
        os.kill(process, signal.SIGKILL)
        call.wait(60)
        self.assertEqual(len(list(self.saves.glob("*.part"))), 1)
        self.assertEqual([path.name for path in self.saves.iterdir() if path.suffix != ".part"], ["map"])
        self.expect_whole(self.saves / "map")

    def test_reset_begins_anew_in_all_nodes(self):
        launch = self.play_on(f"output:={self.path / 'reset'}", "rate:=0.5")
        launch.wait_for_topic("/fdi_lio/odometry/lidar/header", 60)
        answer = self.call(launch, "reset")
        self.assertTrue(answer["success"], answer)
        self.wait_for_end(launch)
        text = launch.stop()
        self.assertIn("a reset was asked for", text)
        self.assertNotIn("does not answer", text)
        before = read_tum(self.path / "reset/trajectory.tum")
        after = read_tum(self.path / "reset_2/trajectory.tum")
        # No scan is lost but those that waited, and the new map has its origin where it began.
        self.assertLess(after[0, 0] - before[-1, 0], 0.5)
        self.assertGreater(np.linalg.norm(before[-1, 1:4]), 1.0)
        self.assertLess(np.linalg.norm(after[0, 1:4]), 1e-6)
        self.expect_same_way(before, read_tum(self.path / "street.tum"))
        # Begun at full speed with 16 beams, the first metres are less sure: only that it goes on is asked.
        self.assertTrue(np.isfinite(after).all())
        self.assertGreater(len(before) + len(after), 140)

    def make_session(self):
        """A session of the recording, made by offline_slam; its map is that of the run `offline`."""
        subprocess.run([BIN / "offline_slam", "--config", self.config, "--bag", self.bag, "--output",
                        self.saves / "run", "--set", "loop.save_session=true"], check=True, capture_output=True)
        return self.saves / "run/session"

    def expect_in_session(self, trajectory):
        """From when the place was found, after some seconds, all poses are those that made the session."""
        poses = read_tum(trajectory)
        made = read_tum(self.path / "offline/trajectory.tum")
        self.assertGreater(len(poses), 20)
        expected = np.stack([np.interp(poses[:, 0], made[:, 0], made[:, k]) for k in (1, 2, 3)], axis=1)
        self.assertLess(np.linalg.norm(poses[:, 1:4] - expected, axis=1).max(), 0.3)

    def test_localises_in_the_session_of_the_parameters(self):
        session = self.make_session()
        launch = self.play("localised", f"session:={session}")
        self.expect_failure(self.save(launch, self.saves / "map"), "localising in a session")
        launch.wait()
        self.expect_in_session(self.path / "localised/trajectory.tum")
        self.assertIn("tracking", (self.path / "localised/localisation.csv").read_text(encoding="utf-8"))

    def test_load_map_refuses_what_is_damaged_and_localises_in_what_is_whole(self):
        session = self.make_session()
        damaged = self.saves / "damaged"
        shutil.copytree(session, damaged)
        with open(damaged / "keyframes/000003.pcd", "r+b") as file:
            file.seek(-1, os.SEEK_END)
            file.write(b"#")
        launch = self.play_on(f"output:={self.path / 'loaded'}", "rate:=0.3")
        launch.wait_for_topic("/fdi_lio/odometry/lidar/header", 30)
        for path, text in ((damaged, "keyframes/000003.pcd is not what was saved"), (self.path, "no session.yaml"),
                           (self.saves / "nowhere", "no folder"), ("relative", "not absolute")):
            answer = self.call(launch, "load_map", {"path": str(path)})
            self.assertFalse(answer["success"])
            self.assertIn(text, answer["message"])
        answer = self.call(launch, "load_map", {"path": str(session)})
        self.assertTrue(answer["success"], answer)
        self.assertGreater(answer["keyframes"], 20)
        self.wait_for_end(launch)
        launch.stop()
        # What was mapped before is one result, the poses in the session another.
        self.assertGreater(len(read_tum(self.path / "loaded/trajectory.tum")), 20)
        self.expect_in_session(self.path / "loaded_2/trajectory.tum")


if __name__ == "__main__":
    run_tests()
