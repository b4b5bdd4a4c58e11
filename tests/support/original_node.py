"""A node of rospy that gestures as the original's does: blind, for nobody's stop.

Written from docs/reference/original.md#robot; run by the system's Python. Each part of a gesture is
one Twist, and a pause; what is said meanwhile waits. Between two gestures it pauses for 5 s.
"""

import sys

PARTS = (  # of its positive gesture: m/s, rad/s, and the pause after it [s]
    (0.2, 0.0, 1.0),
    (0.0, 0.0, 1.0),
    (0.0, 1.8, 2.0),
    (0.0, -1.8, 2.0),
    (-0.2, 0.0, 1.0),
    (0.0, 0.0, 0.0),
)
PAUSE_S = 5.0


def main():
    import rospy
    from geometry_msgs.msg import Twist
    from std_msgs.msg import Bool

    rospy.init_node("gesture_generation")
    orders = rospy.Publisher("/mobile_base/commands/velocity", Twist, queue_size=10)
    good_steps = []
    rospy.Subscriber("/garry/good_step", Bool, lambda said: good_steps.append(said.data))
    rospy.sleep(PAUSE_S)
    while not rospy.is_shutdown():
        while good_steps and not good_steps[0]:
            good_steps.pop(0)
        if not good_steps:
            rospy.sleep(0.1)
            continue
        good_steps.pop(0)
        for v_m_s, w_rad_s, pause_s in PARTS:
            twist = Twist()
            twist.linear.x, twist.angular.z = v_m_s, w_rad_s
            orders.publish(twist)
            rospy.sleep(pause_s)
        rospy.sleep(PAUSE_S)


if __name__ == "__main__":
    sys.exit(main())
