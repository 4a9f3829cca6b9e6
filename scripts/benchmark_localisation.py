#!/usr/bin/python3
"""Measures localisation in a saved session: a session is recorded in a simulated place, then recordings of other drives
there, with other sensor errors and from other starts, half of them in the other direction, are localised in it.

For each start: how long it took until the place was found, whether it was the right one, and the error of the poses
from then on: their ATE (aligned to their truth, as everywhere), and without any alignment of their own in the session
(against where the session puts its own nearest pose) and in the world (the session is put where its own truth says,
and its own error adds).
"""
import argparse
import pathlib
import subprocess
import sys

import numpy as np

WRONG_M = 1.0  # a pose so far off is a wrong place


def parse_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--bin", required=True, help="folder of offline_slam and simulate_bag")
    parser.add_argument("--scenario", required=True, help="config/scenarios/NAME.yaml")
    parser.add_argument("--output", required=True, help="folder for all files")
    parser.add_argument("--seed", type=int, default=2, help="of the place")
    parser.add_argument("--session-duration", type=float, default=60.0, help="of the recording of the session [s]")
    parser.add_argument("--duration", type=float, default=20.0, help="of each drive [s]")
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--initial-error", type=float, metavar="M",
                        help="give each drive an initial pose that is off by this (standard deviation along each "
                             "axis; 5 degrees of heading); without: none")
    parser.add_argument("--simulate", action="append", default=[], metavar="KEY=VALUE", help="for the simulator")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="for offline_slam")
    return parser.parse_args()


class Drives:
    """Recordings in one place."""

    def __init__(self, arguments):
        self.arguments = arguments
        self.bin = pathlib.Path(arguments.bin)
        self.path = pathlib.Path(arguments.output)
        self.path.mkdir(parents=True, exist_ok=True)

    def simulate(self, name, duration_s, *options):
        command = [self.bin / "simulate_bag", "--scenario", self.arguments.scenario, "--seed", self.arguments.seed,
                   "--duration", duration_s, "--output", self.path / f"{name}.bag", *options]
        for setting in self.arguments.simulate:
            command += ["--set", setting]
        subprocess.run([str(part) for part in command], check=True, capture_output=True)

    def run(self, name, *options):
        """Returns what offline_slam says and whether it went well."""
        command = [self.bin / "offline_slam", "--config", self.path / f"{name}.config.yaml", "--bag",
                   self.path / f"{name}.bag", "--output", self.path / name, *options]
        for setting in self.arguments.set:
            command += ["--set", setting]
        done = subprocess.run([str(part) for part in command], check=False, capture_output=True, text=True)
        (self.path / f"{name}.bag").unlink()
        (self.path / f"{name}.labels").unlink()
        return done.returncode == 0, done.stderr

    def truth_at(self, name, stamps):
        truth = np.loadtxt(self.path / f"{name}.tum")
        return np.stack([np.interp(stamps, truth[:, 0], truth[:, k]) for k in (1, 2, 3)], axis=1)

    def guess(self, name, rotation, translation, seed):
        """Options with an initial pose in the session's map, world = rotation map + translation."""
        sigma_m, random = self.arguments.initial_error, np.random.default_rng(seed)
        first = np.loadtxt(self.path / f"{name}.tum")[0]
        x, y = (rotation.T @ (first[1:4] - translation))[:2] + sigma_m * random.standard_normal(2)
        qx, qy, qz, qw = first[4:8]
        yaw = np.arctan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy ** 2 + qz ** 2)) - np.arctan2(rotation[1, 0], rotation[0, 0])
        yaw_deg = np.degrees(yaw) + 5.0 * random.standard_normal()
        return ["--initial-pose", f"{x:.3f} {y:.3f} {yaw_deg:.2f}", "--set",
                f"localisation.initial_sigma_translation={max(sigma_m, 0.1)}"]


def rigid(source, target):
    """R, t of the least squares target = R source + t."""
    p0, q0 = source.mean(axis=0), target.mean(axis=0)
    u, _, vt = np.linalg.svd((target - q0).T @ (source - p0))
    rotation = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return rotation, q0 - rotation @ p0


def rms(values):
    return float(np.sqrt((values ** 2).mean()))


def main():
    arguments = parse_arguments()
    drives = Drives(arguments)
    drives.simulate("session", arguments.session_duration)
    is_good, text = drives.run("session", "--set", "loop.save_session=true")
    if not is_good:
        sys.exit(text)
    session = np.loadtxt(drives.path / "session/trajectory.tum")
    rotation, translation = rigid(session[:, 1:4], drives.truth_at("session", session[:, 0]))
    truth_of_session = drives.truth_at("session", session[:, 0])
    residual = session[:, 1:4] @ rotation.T + translation - truth_of_session
    way = np.loadtxt(drives.path / "session.tum")
    length = np.linalg.norm(np.diff(way[:, 1:4], axis=0), axis=1).sum()
    print(f"session: {length:.0f} m, ATE {np.sqrt((residual ** 2).sum(axis=1).mean()):.3f} m", flush=True)
    print("start s  reversed  found s  ATE m  session m  world m  worst m  off the session's way m", flush=True)
    results = []
    for k in range(arguments.starts):
        start, is_reversed = int(arguments.session_duration * (k + 1) / (arguments.starts + 1)), k % 2 == 1
        name = f"start_{k:02d}"
        drives.simulate(name, arguments.duration, "--revisit", start, "--reversed", "yes" if is_reversed else "no",
                        "--noise-seed", 1000 + k)
        guess = [] if arguments.initial_error is None else drives.guess(name, rotation, translation, k)
        is_found, _ = drives.run(name, "--localise", drives.path / "session/session", *guess)
        begin = np.loadtxt(drives.path / name / "odometry.tum")[0, 0]
        beside = np.linalg.norm(way[:, 1:4] - np.loadtxt(drives.path / f"{name}.tum")[0, 1:4], axis=1).min()
        found_s, ate, local, world, worst = float("inf"), *4 * [float("nan")]
        if is_found:
            poses = np.loadtxt(drives.path / name / "trajectory.tum", ndmin=2)
            found_s = poses[0, 0] - begin
            truth = drives.truth_at(name, poses[:, 0])
            error = poses[:, 1:4] @ rotation.T + translation - truth
            nearest = [np.argmin(np.linalg.norm(truth_of_session - p, axis=1)) for p in truth]
            length_of = np.linalg.norm(error, axis=1)
            world, worst = rms(length_of), length_of.max()
            own_rotation, own_translation = rigid(poses[:, 1:4], truth)
            ate = rms(np.linalg.norm(poses[:, 1:4] @ own_rotation.T + own_translation - truth, axis=1))
            local = rms(np.linalg.norm(error - residual[nearest], axis=1))
        results.append((found_s, worst, ate, local, world))
        print(f"{start:7d}  {is_reversed!s:8}  {found_s:7.1f}  {ate:5.3f}  {local:9.3f}  {world:7.3f}  {worst:7.3f}  "
              f"{beside:6.2f}", flush=True)
    found = np.array(results)
    print(f"found within 10 s: {(found[:, 0] <= 10.0).mean():.0%}; wrong places: {(found[:, 1] > WRONG_M).sum()}")
    for name, errors in zip(("ATE", "rms error in the session", "rms error in the world"), found[:, 2:].T):
        print(f"{name} of a drive: median {np.nanmedian(errors):.3f} m, largest {np.nanmax(errors):.3f} m")


if __name__ == "__main__":
    main()
