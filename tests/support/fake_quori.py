"""A Quori behind its controllers, as docs/reference/rosbridge.md#names-of-a-quori.

Its body stands on a turret, 0.1 m ahead of the axle of two wheels. To move the body sideways the
axle turns below it, and the turret turns back. Its odometry is the axle's, with the velocity in the
frame where it began; the turret's angle comes beside it. It takes orders of one program alone.
"""

import math

from tests.support.late_body import LateBody, write_odometry

TWIST = "geometry_msgs/Twist"
ORDER, ODOM = "/quori/base_controller/cmd_vel", "/quori/base_controller/odom"
JOINTS = "/quori/joint_trajectory_controller/command"
NAMES = (
    *("r_shoulder_pitch", "r_shoulder_roll"),
    *("l_shoulder_pitch", "l_shoulder_roll", "waist_pitch"),
)
LOOP_S, TIMEOUT_S, AHEAD_M = 0.02, 0.25, 0.1
DEAD_TIME_S, LAG_S = 0.08, 0.08  # assumed: nobody has measured one for us
TURRET_MAX_RAD_S = 3.49


class FakeQuori:
    def __init__(self, graph, clock):
        self.graph, self.clock = graph, clock
        self.body = LateBody(clock, DEAD_TIME_S, LAG_S)
        self.axle_rad = self.body.heading_rad - 0.7  # the axle is wherever it was left
        # Its axle by its wheels: x, y and heading.
        self.rolled = (0.0, 0.0, 0.0)
        self.at_rad = dict.fromkeys(NAMES, 0.0)
        self.motions, self.fastest_rad_s = {}, 0.0
        self.orders, self.is_turret_mute = [], False
        self._twist, self._ordered_s, self._looped_s = (0.0, 0.0, 0.0), -9.0, -9.0
        self._seen = None
        graph.subscribe(ORDER, TWIST, self.follow)
        graph.subscribe(JOINTS, "trajectory_msgs/JointTrajectory", self.move_joints)
        graph.advertise(ODOM, "nav_msgs/Odometry", "/quori")
        graph.advertise("/joint_states", "sensor_msgs/JointState", "/quori")

    @property
    def is_moving(self):
        return self.body.is_moving

    @property
    def are_joints_moving(self):
        return bool(self.motions)

    def angles(self):
        return dict(self.at_rad)

    def push_aside(self, by_m):
        """Drag it to its left; its wheels roll and turn as they would."""
        heading = self.body.heading_rad
        self.body.x_m -= by_m * math.sin(heading)
        self.body.y_m += by_m * math.cos(heading)
        x_m, y_m, axle_rad = self.rolled
        told = heading - self.axle_rad + axle_rad
        self.rolled = x_m - by_m * math.sin(told), y_m + by_m * math.cos(told), axle_rad

    def follow(self, message):
        linear, angular = message["linear"], message["angular"]
        twist = linear["x"], angular["z"], linear["y"]
        self.orders.append((self.clock(), *twist))
        if len(self.graph.publishers[ORDER]) == 1:  # else: "Going to brake"
            self._twist, self._ordered_s = twist, self.clock()

    def move_joints(self, message):
        """Follow a trajectory of one point by a cubic; one without points holds."""
        now_s, names = self.clock(), message["joint_names"]
        if not message["points"]:
            self.motions = {}
            return
        if sorted(names) != sorted(NAMES):  # partial goals are not allowed
            return
        (point,) = message["points"]
        takes = point["time_from_start"]
        took_s = takes["secs"] + 1e-9 * takes["nsecs"]
        pairs = zip(names, point["positions"], strict=True)
        self.motions = {n: (self.at_rad[n], to, now_s, took_s) for n, to in pairs}

    def tell(self):
        """Let time pass, and run its controllers, 50 times a second."""
        for span_s in self.body.move():
            v, vy, w = self.body.velocity
            # What the body does along and across the axle: the wheels cannot slide across.
            angle = self.body.heading_rad - self.axle_rad
            along = v * math.cos(angle) - vy * math.sin(angle)
            turned = (v * math.sin(angle) + vy * math.cos(angle)) / AHEAD_M
            assert abs(w - turned) <= TURRET_MAX_RAD_S, "the turret cannot follow"
            self.axle_rad += turned * span_s * (1 - self.body.slips)
            along *= 1 + self.body.chance.gauss(0, 0.02)  # as its wheels tell
            turned *= 1 + self.body.chance.gauss(0, 0.02)
            x_m, y_m, axle_rad = self.rolled
            midway = axle_rad + turned * span_s / 2
            x_m, y_m = (
                x_m + along * span_s * math.cos(midway),
                y_m + along * span_s * math.sin(midway),
            )
            self.rolled = x_m, y_m, axle_rad + turned * span_s
        for name, (from_rad, to_rad, began_s, took_s) in list(self.motions.items()):
            share = min((self.clock() - began_s) / took_s, 1.0)
            was = self.at_rad[name]
            self.at_rad[name] = from_rad + (to_rad - from_rad) * share * share * (3 - 2 * share)
            speed = abs(self.at_rad[name] - was) / LOOP_S
            self.fastest_rad_s = max(self.fastest_rad_s, speed)
            if share == 1.0:
                del self.motions[name]
        if self.clock() - self._looped_s >= LOOP_S - 1e-6:
            self._looped_s = self.clock()
            self._loop()

    def _loop(self):
        now_s, body = self.clock(), self.body
        is_fresh = now_s - self._ordered_s <= TIMEOUT_S
        body.order(*(self._twist if is_fresh else (0.0, 0.0, 0.0)))
        x_m, y_m, axle_rad = self.rolled
        before, self._seen = self._seen or self.rolled, self.rolled
        velocity = [(now - then) / LOOP_S for now, then in zip(self._seen, before, strict=True)]
        self.graph.publish(
            ODOM, write_odometry(x_m, y_m, axle_rad, velocity[:2], velocity[2], now_s)
        )
        turret_rad = round(body.heading_rad - self.axle_rad, 3)  # of its encoder (assumed)
        names = ["turret", "l_wheel", "r_wheel", *NAMES]
        positions = [turret_rad, 0.0, 0.0, *self.at_rad.values()]
        if not self.is_turret_mute:
            self.graph.publish("/joint_states", {"name": names, "position": positions})
