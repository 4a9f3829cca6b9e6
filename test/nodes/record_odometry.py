#!/usr/bin/python3
"""Writes one line for each IMU reading and odometry message until the master ends: topic stamp x y z.

usage: record_odometry.py FILE
"""
import sys

import rospy
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Imu

with open(sys.argv[1], "w", encoding="utf-8") as out:

    def on_imu(message):
        out.write(f"imu {message.header.stamp.to_nsec()} 0 0 0\n")

    def on_odometry(message, topic):
        p = message.pose.pose.position
        out.write(f"{topic} {message.header.stamp.to_nsec()} {p.x} {p.y} {p.z}\n")
        out.flush()

    rospy.init_node("record_odometry")
    rospy.Subscriber("/imu_raw", Imu, on_imu, queue_size=10000)
    rospy.Subscriber("/fdi_lio/odometry/imu", Odometry, on_odometry, "imu_odometry", queue_size=10000)
    rospy.Subscriber("/fdi_lio/odometry/lidar", Odometry, on_odometry, "lidar_odometry", queue_size=10000)
    rospy.spin()
