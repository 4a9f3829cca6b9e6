"""Recordings with settings drawn at random: sensors, mountings, IMUs, places and motions as users bring them."""

import math
import random
from dataclasses import dataclass, field
from typing import Dict, List, Sequence, Tuple

# Usual speeds [m/s] of the scenarios. Dense traffic and crowds are left to the hard ones; a hand needs a dense sensor, and
# 16 beams see too little of a motorway.
SPEEDS_MPS = {"street": 13.0, "tunnel": 14.0, "street_tunnel": 13.0, "highway": 28.0, "corridor": 1.6, "mine": 5.0,
              "plaza": 2.4, "forest": 4.0}
MODELS = ["vlp16", "os1_64", "hdl64e", "os0_128"]
MODELS_ON_A_HIGHWAY = ["os1_64", "hdl64e"]
STAMPED_AT_END = ["vlp16", "hdl64e"]
TUNING_SEEDS = range(1, 11)

# Key, share of recordings that keep the usual value, and what the others draw from.
SIMPLE: List[Tuple[str, float, Sequence[object]]] = [
    ("lidar.rate", 0.6, [5, 20]),
    ("lidar.columns", 0.6, [512, 900, 1024, 2048]),
    ("lidar.start_azimuth", 0.5, [-150, -90, 45, 90, 170]),
    ("lidar.latency", 0.7, [0.03, 0.1]),
    ("imu.rate", 0.5, [50, 100, 400, 500]),
    ("imu.gravity", 0.6, [9.78, 9.83]),
    ("imperfections.time_offset", 0.7, [-0.02, 0.0, 0.02]),
    ("motion.vibration", 0.6, [0, 3]),
    ("world.dust", 0.8, [0.002, 0.005]),
    ("world.texture", 0.7, [0, 0.5, 1.5]),
    ("world.relief", 0.7, [0.5, 1.5]),
]


@dataclass
class Variation:
    """A scenario and the settings of the simulator that differ from it."""

    scenario: str
    seed: int
    settings: Dict[str, str] = field(default_factory=dict)


def draw(number: int) -> Variation:
    """The same variation for the same number."""
    dice = random.Random(number)
    variation = Variation(dice.choice(list(SPEEDS_MPS)), dice.choice(TUNING_SEEDS))
    settings = variation.settings
    model = dice.choice(MODELS_ON_A_HIGHWAY if variation.scenario == "highway" else MODELS)
    settings["lidar.model"] = model
    if model in STAMPED_AT_END and dice.random() < 0.3:
        settings["lidar.stamp_at_end"] = "true"
    for key, share, others in SIMPLE:
        if dice.random() >= share:
            settings[key] = str(dice.choice(others))
    _draw_mounting(dice, settings)
    _draw_imu(dice, settings)
    _draw_imperfections(dice, settings)
    _draw_motion(dice, variation.scenario, settings)
    _draw_ranges(dice, settings)
    return variation


def _draw_mounting(dice: random.Random, settings: Dict[str, str]) -> None:
    """Turned about the vertical, tilted, and off the IMU by up to a metre."""
    yaw = math.radians(dice.choice([0, 0, 0, 45, 90, 180, 270]))
    pitch = math.radians(dice.choice([0, 0, 0, -15, 5, 20]))
    x, y, z, w = (-math.sin(0.5 * pitch) * math.sin(0.5 * yaw), math.sin(0.5 * pitch) * math.cos(0.5 * yaw),
                  math.cos(0.5 * pitch) * math.sin(0.5 * yaw), math.cos(0.5 * pitch) * math.cos(0.5 * yaw))
    settings["lidar.T_imu_lidar.rotation"] = f"[{x:.9f}, {y:.9f}, {z:.9f}, {w:.9f}]"
    place = [dice.uniform(-0.8, 0.8), dice.uniform(-0.4, 0.4), dice.uniform(0.0, 0.6)]
    settings["lidar.T_imu_lidar.translation"] = "[" + ", ".join(f"{number:.2f}" for number in place) + "]"


def _draw_imu(dice: random.Random, settings: Dict[str, str]) -> None:
    noise = dice.choice([0.1, 1.0, 1.0, 1.0, 3.0, 10.0])
    settings["imu.gyro_noise"] = f"{2e-4 * noise:g}"
    settings["imu.accel_noise"] = f"{2e-3 * noise:g}"
    bias = dice.choice([0.0, 1.0, 1.0, 1.0, 5.0, 15.0])
    settings["imu.gyro_bias"] = f"{3e-3 * min(bias, 5.0):g}"
    settings["imu.accel_bias"] = f"{3e-2 * bias:g}"


def _draw_imperfections(dice: random.Random, settings: Dict[str, str]) -> None:
    size = dice.choice([0, 1, 1, 1, 2])
    if size == 0:
        settings["imperfections.enabled"] = "false"
    elif size == 2:
        settings.update({"imperfections.beam_elevation": "0.06", "imperfections.beam_azimuth": "0.06",
                         "imperfections.beam_range": "0.03", "imperfections.extrinsic_rotation": "0.4",
                         "imperfections.extrinsic_translation": "0.02",
                         "imperfections.gyro_scale": "0.01", "imperfections.accel_scale": "0.01",
                         "imperfections.imu_axes": "0.3"})


def _draw_motion(dice: random.Random, scenario: str, settings: Dict[str, str]) -> None:
    speed_mps = SPEEDS_MPS[scenario] * dice.choice([0.5, 1.0, 1.0, 1.4])
    settings["motion.speed"] = f"{speed_mps:.2f}"
    start = dice.choice([0.0, 0.0, 0.0, 0.5, 0.9])
    if scenario != "highway":
        settings["motion.start_speed"] = f"{start * speed_mps:.2f}"


def _draw_ranges(dice: random.Random, settings: Dict[str, str]) -> None:
    """A range finder from ideal to cheap, and one that sees near things only."""
    if dice.random() < 0.4:
        settings["lidar.range_noise"] = str(dice.choice([0, 0.005, 0.04]))
    if dice.random() < 0.2:
        settings["lidar.max_range"] = str(dice.choice([30, 60]))
