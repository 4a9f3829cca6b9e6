"""Copies of a recording, each broken in one way."""
import copy

import genpy
import numpy as np
import rosbag

POINTS, IMU = "/points_raw", "/imu_raw"
# The layout of the Velodyne driver, as simulate_bag writes it.
POINT = np.dtype({
    "names": ["x", "y", "z", "intensity", "ring", "time"],
    "formats": ["<f4", "<f4", "<f4", "<f4", "<u2", "<f4"],
    "offsets": [0, 4, 8, 12, 16, 18],
    "itemsize": 22,
})


def rewrite(source, target, change):
    """Writes what `change(topic, message, time)` gives for each lidar and IMU message: (topic, message, time)s."""
    with rosbag.Bag(str(source)) as bag, rosbag.Bag(str(target), "w") as out:
        for topic, message, time in bag.read_messages([POINTS, IMU]):
            for entry in change(topic, message, time):
                out.write(*entry)


def for_topic(wanted, change):
    """A change of one topic: `change(index, message, time)` gives the messages to write in its place."""
    count = 0

    def apply(topic, message, time):
        nonlocal count
        if topic != wanted:
            return [(topic, message, time)]
        count += 1
        return [(topic, *entry) for entry in change(count - 1, message, time)]

    return apply


def clouds(change):
    """A change of every cloud in place: `change(index, message)`."""

    def apply(index, message, time):
        change(index, message)
        return [(message, time)]

    return for_topic(POINTS, apply)


def readings(change):
    """A change of every IMU reading in place: `change(index, message)`."""

    def apply(index, message, time):
        change(index, message)
        return [(message, time)]

    return for_topic(IMU, apply)


def without_field(name):
    return clouds(lambda _, cloud: setattr(cloud, "fields", [f for f in cloud.fields if f.name != name]))


def every_point(name_to_value, every=1):
    """Overwrites fields of all points in every `every`-th cloud."""

    def change(index, cloud):
        if index % every:
            return
        points = np.frombuffer(cloud.data, POINT).copy()
        for name, value in name_to_value.items():
            points[name] = value
        cloud.data = points.tobytes()

    return clouds(change)


def set_points(cloud, data, step):
    cloud.data = data
    cloud.point_step = step
    cloud.width = len(data) // step
    cloud.row_step = len(data)


def emptied(every):
    return clouds(lambda i, cloud: set_points(cloud, b"", 22) if i % every == 0 else None)


def doubled_points(_, cloud):
    set_points(cloud, np.repeat(np.frombuffer(cloud.data, POINT), 2).tobytes(), 22)


def odd_step(_, cloud):
    """27 bytes a point: five bytes of padding."""
    rows = np.frombuffer(cloud.data, np.uint8).reshape(-1, 22)
    set_points(cloud, np.hstack([rows, np.full((len(rows), 5), 0xFF, np.uint8)]).tobytes(), 27)


def shifted(message, seconds):
    """A copy with another stamp."""
    moved = copy.deepcopy(message)
    moved.header.stamp = message.header.stamp + genpy.Duration.from_sec(seconds)
    return moved


def shift_stamps(seconds_of_index):
    """A change that adds `seconds_of_index(i)` to the i-th stamp of its topic."""
    return lambda i, message, time: [(shifted(message, seconds_of_index(i)), time)]


def neighbours_swapped(every):
    """Every `every`-th message comes after its successor."""
    held = []

    def change(index, message, time):
        if index % every == 0:
            held.append(message)
            return []
        entries = [(message, time)] + [(late, time) for late in held]
        held.clear()
        return entries

    return change


def all_of(*changes):
    """One change after the other."""

    def apply(topic, message, time):
        entries = [(topic, message, time)]
        for change in changes:
            entries = [result for entry in entries for result in change(*entry)]
        return entries

    return apply


def write_without_index(source, target):
    """What a recorder leaves behind that was killed: the file as it was before it was closed."""
    unfinished = target.with_suffix(".active")
    with rosbag.Bag(str(source)) as bag, rosbag.Bag(str(unfinished), "w", chunk_threshold=100000) as out:
        for topic, message, time in bag.read_messages([POINTS, IMU]):
            out.write(topic, message, time)
        out.flush()
        target.write_bytes(unfinished.read_bytes())


def cut_messages(source, target, wanted, every):
    """Every `every`-th message of the topic loses its second half."""
    count = 0
    with rosbag.Bag(str(source)) as bag, rosbag.Bag(str(target), "w") as out:
        for topic, (kind, data, md5, position, classes), time in bag.read_messages([POINTS, IMU], raw=True):
            if topic == wanted:
                count += 1
                if count % every == 0:
                    data = data[:len(data) // 2]
            out.write(topic, (kind, data, md5, position, classes), time, raw=True)


def damage_chunk(source, target, place):
    """Overwrites some bytes of a compressed bag at the share `place` of its length."""
    with rosbag.Bag(str(source)) as bag, rosbag.Bag(str(target), "w", compression="bz2") as out:
        for topic, message, time in bag.read_messages([POINTS, IMU]):
            out.write(topic, message, time)
    data = bytearray(target.read_bytes())
    begin = int(place * len(data))
    data[begin:begin + 100] = bytes(100)
    target.write_bytes(data)
