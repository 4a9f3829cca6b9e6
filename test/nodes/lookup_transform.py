#!/usr/bin/python3
"""Prints translation and rotation of T_target_source as tf knows it. usage: lookup_transform.py TARGET SOURCE"""
import sys

import rospy
import tf2_ros

rospy.init_node("lookup_transform", anonymous=True)
buffer = tf2_ros.Buffer()
listener = tf2_ros.TransformListener(buffer)
for _ in range(200):
    try:
        transform = buffer.lookup_transform(sys.argv[1], sys.argv[2], rospy.Time(0)).transform
        break
    except tf2_ros.TransformException as error:
        reason = error
        rospy.rostime.wallsleep(0.1)
else:
    sys.exit(f"tf does not know {sys.argv[1]} -> {sys.argv[2]}: {reason}")
t, q = transform.translation, transform.rotation
print(t.x, t.y, t.z, q.x, q.y, q.z, q.w)
