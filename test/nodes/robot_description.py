#!/usr/bin/python3
"""Publishes base_link -> imu_link (identity) and base_link -> velodyne (0.3 m up), as a robot's own URDF would."""
import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped


def transform(child, z):
    message = TransformStamped()
    message.header.frame_id = "base_link"
    message.child_frame_id = child
    message.transform.translation.z = z
    message.transform.rotation.w = 1.0
    return message


rospy.init_node("robot_description")
broadcaster = tf2_ros.StaticTransformBroadcaster()
broadcaster.sendTransform([transform("imu_link", 0.0), transform("velodyne", 0.3)])
rospy.spin()
