"""Any base that ROS drives, by way of a rosbridge."""

from robot.bases.rosbridge.base import RosbridgeBase

__all__ = ["RosbridgeBase"]
