#!/usr/bin/python3
"""Publishes base_link -> imu_link (identity) and base_link -> velodyne (0.3 m up), as a robot's own URDF would.

usage: robot_description.py QX QY QZ QW    (rotation of the lidar)
"""
import rospy
import tf2_ros
from geometry_msgs.msg import Quaternion, TransformStamped


def transform(child, z, rotation):
    message = TransformStamped()
    message.header.frame_id = "base_link"
    message.child_frame_id = child
    message.transform.translation.z = z
    message.transform.rotation = Quaternion(*rotation)
    return message


rospy.init_node("robot_description")
broadcaster = tf2_ros.StaticTransformBroadcaster()
broadcaster.sendTransform([
    transform("imu_link", 0.0, (0.0, 0.0, 0.0, 1.0)),
    transform("velodyne", 0.3, [float(number) for number in rospy.myargv()[1:5]]),
])
rospy.spin()
